#include "ros/message_pool.hpp"

#include <gtest/gtest.h>
#include <sensor_msgs/Image.h>

namespace leap_object_tracker {
namespace {

TEST(MessagePool, givesTheSameMessageAgainWhenEverybodyLetGo) {
  MessagePool<sensor_msgs::Image> pool;
  const sensor_msgs::Image* first = pool.take().get();
  EXPECT_EQ(pool.take().get(), first);
}

TEST(MessagePool, givesAnotherOneWhileSomebodyHoldsIt) {
  MessagePool<sensor_msgs::Image> pool;
  const sensor_msgs::ImageConstPtr held = pool.take();
  EXPECT_NE(pool.take().get(), held.get());
}

TEST(MessagePool, keepsTheMemoryOfTheMessage) {
  MessagePool<sensor_msgs::Image> pool;
  pool.take()->data.resize(1000);
  EXPECT_GE(pool.take()->data.capacity(), 1000u);
}

}  // namespace
}  // namespace leap_object_tracker
