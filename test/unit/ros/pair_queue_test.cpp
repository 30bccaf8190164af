#include "ros/pair_queue.hpp"

#include <gtest/gtest.h>

#include <boost/make_shared.hpp>

namespace leap_object_tracker {
namespace {

StereoMessages pairNumber(std::uint32_t number) {
  const auto image = boost::make_shared<sensor_msgs::Image>();
  image->header.seq = number;
  StereoMessages pair;
  pair.left = image;
  return pair;
}

std::uint32_t nextNumber(PairQueue& queue) { return queue.next().value().header().seq; }

TEST(PairQueue, givesEachPairOnceToAListenerInTime) {
  PairQueue queue;
  EXPECT_FALSE(queue.next());
  for (std::uint32_t number = 0; number < 20; ++number) {
    queue.push(pairNumber(number));
    EXPECT_EQ(nextNumber(queue), number);
    EXPECT_TRUE(queue.empty());
  }
  EXPECT_EQ(queue.dropped(), 0u);
}

TEST(PairQueue, losesNoneWhenItsListenerIsLateForAMoment) {
  PairQueue queue;
  for (std::uint32_t number = 0; number < 3; ++number) queue.push(pairNumber(number));
  for (std::uint32_t number = 0; number < 3; ++number) EXPECT_EQ(nextNumber(queue), number);
  EXPECT_EQ(queue.dropped(), 0u);
}

TEST(PairQueue, givesTheNewestAfterALongPause) {
  PairQueue queue;
  for (std::uint32_t number = 0; number < 4; ++number) queue.push(pairNumber(number));
  EXPECT_EQ(nextNumber(queue), 3u);
  EXPECT_TRUE(queue.empty());
  EXPECT_EQ(queue.dropped(), 3u);
}

TEST(PairQueue, doesNotLetAListenerThatIsTooSlowFallBehind) {
  PairQueue queue;
  std::uint32_t number = 0, farthest_behind = 0;
  for (int i = 0; i < 100; ++i) {  // two pairs come while one is worked on
    queue.push(pairNumber(++number));
    queue.push(pairNumber(++number));
    const std::uint32_t seen = nextNumber(queue);
    farthest_behind = std::max(farthest_behind, number - seen);
  }
  EXPECT_LE(farthest_behind, 2u);
  EXPECT_GT(queue.dropped(), 80u);
}

TEST(PairQueue, givesTheNewestToAListenerThatStaysJustOneBehind) {
  PairQueue queue;
  std::uint32_t number = 0;
  queue.push(pairNumber(++number));
  for (int i = 0; i < 5; ++i) {
    queue.push(pairNumber(++number));
    nextNumber(queue);
  }
  EXPECT_TRUE(queue.empty());
  EXPECT_EQ(queue.dropped(), 1u);
}

}  // namespace
}  // namespace leap_object_tracker
