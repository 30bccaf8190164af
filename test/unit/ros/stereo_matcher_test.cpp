#include "ros/stereo_matcher.hpp"

#include <gtest/gtest.h>

#include <boost/make_shared.hpp>

namespace leap_object_tracker {
namespace {

class StereoMatcherTest : public testing::Test {
 protected:
  std::optional<StereoMessages> addLeft(double stamp) {
    StereoMessages part;
    part.left = boost::make_shared<sensor_msgs::Image>();
    return matcher_.add(ros::Time(stamp), part);
  }
  std::optional<StereoMessages> addRight(double stamp) {
    StereoMessages part;
    part.right = boost::make_shared<sensor_msgs::Image>();
    return matcher_.add(ros::Time(stamp), part);
  }
  std::optional<StereoMessages> addInfo(double stamp, bool right) {
    StereoMessages part;
    (right ? part.right_info : part.left_info) = boost::make_shared<sensor_msgs::CameraInfo>();
    return matcher_.add(ros::Time(stamp), part);
  }
  std::optional<StereoMessages> addInfos(double stamp) {
    addInfo(stamp, false);
    return addInfo(stamp, true);
  }

  StereoMatcher matcher_{Eyes::kBoth};
};

TEST_F(StereoMatcherTest, handsOutAPairWhenItsLastPartCame) {
  EXPECT_FALSE(addLeft(1));
  EXPECT_FALSE(addInfos(1));
  const auto pair = addRight(1);
  ASSERT_TRUE(pair);
  EXPECT_TRUE(pair->left && pair->right && pair->left_info && pair->right_info);
}

TEST_F(StereoMatcherTest, neverPairsDifferentStamps) {
  for (int i = 0; i < 100; ++i) {
    EXPECT_FALSE(addLeft(1 + i));
    EXPECT_FALSE(addRight(1.001 + i));
    EXPECT_FALSE(addInfos(1 + i));
  }
}

TEST_F(StereoMatcherTest, goesOnAfterTimeJumpedBack) {
  for (int i = 0; i < 100; ++i) addLeft(1000 + i);  // right ones that never come
  addLeft(5);
  addInfos(5);
  EXPECT_TRUE(addRight(5));
}

TEST_F(StereoMatcherTest, forgetsWhatIsOlderThanAPair) {
  addLeft(1);
  addInfos(1);
  addLeft(2);
  addInfos(2);
  EXPECT_TRUE(addRight(2));
  EXPECT_FALSE(addRight(1));
}

TEST_F(StereoMatcherTest, doesWithOneEyeIfToldSo) {
  matcher_ = StereoMatcher(Eyes::kLeft);
  addLeft(1);
  const auto pair = addInfo(1, false);
  ASSERT_TRUE(pair);
  EXPECT_FALSE(pair->right);
}

}  // namespace
}  // namespace leap_object_tracker
