#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/core/types.hpp>
#include <vector>

#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/geometry/stereo_frame.hpp"
#include "leap_object_tracker/tracking/feature_params.hpp"

namespace leap_object_tracker {

/// SURF descriptor of unit length (Bay et al. 2008).
using FeatureDescriptor = std::array<float, 64>;

float squaredDistance(const FeatureDescriptor& a, const FeatureDescriptor& b);

/// Of Haar wavelets along the columns and rows of an image, at one pixel [grey levels].
struct WaveletResponse {
  std::int16_t u = 0, v = 0;
};

/// A corner that both eyes see.
struct StereoFeature {
  Eigen::Vector3d point_in_camera;  ///< [m] left rectified frame
  Eigen::Matrix3d covariance;       ///< [m^2] of the point
  Eigen::Vector2d left_pixel;       ///< [px]
  double disparity = 0;             ///< [px]
  FeatureDescriptor descriptor;     ///< as the left eye sees it
};

/// A point [m] in the left rectified frame and its covariance [m^2] from a left pixel and a
/// disparity [px], which must be positive, with independent noise.
void triangulate(const RectifiedStereoCamera& camera, const Eigen::Vector2d& left_pixel,
                 double disparity, double corner_sigma, double disparity_sigma,
                 Eigen::Vector3d& point_in_camera, Eigen::Matrix3d& covariance);

/// Where features are looked for.
struct FeatureWindow {
  std::array<cv::Rect, 2> regions;  ///< [px] left, right
  double nearest = 0;               ///< [m] depth
  double farthest = 0;              ///< [m] depth
  double roll = 0;                  ///< [rad] descriptors are turned by, clockwise in the image
};

enum class CornerDetector { kFast, kSurf };

/// Finds corners in both eyes, describes and matches them, and puts the matches into space.
class FeatureExtractor {
 public:
  /// How many of everything the last frame had.
  struct Counts {
    int left_corners = 0;
    int right_corners = 0;
    int matches = 0;   ///< nearest descriptors of each other that pass the ratio test
    int features = 0;  ///< of these with a disparity that the pictures confirm
  };

  FeatureExtractor(const FeatureParams& params, const RectifiedStereoCamera& camera,
                   CornerDetector detector = CornerDetector::kFast);

  /// Without two eyes there are no features.
  const std::vector<StereoFeature>& extract(const RectifiedStereoFrame& frame,
                                            const FeatureWindow& window);

  const Counts& counts() const { return counts_; }

 private:
  struct Corner {
    cv::Point place;  ///< [px] of the resampled region
    float strength = 0;
    FeatureDescriptor descriptor;
  };
  /// One eye's region, resampled and with a margin for descriptors.
  struct EyeImage {
    cv::Mat scaled;
    cv::Point2d origin;  ///< [px] image place of the pixel (0, 0)
    cv::Mat taken;       ///< not zero where a corner is close by
    std::vector<cv::KeyPoint> found;
    std::vector<Corner> corners;
    std::vector<WaveletResponse> responses;
  };

  /// The likest corners of the other eye.
  struct Best {
    float distance = std::numeric_limits<float>::infinity(), second = distance;  ///< squared
    int index = -1;
  };

  void prepare(const cv::Mat& image, const cv::Rect& region, double zoom, double roll,
               EyeImage& eye) const;
  void findFast(EyeImage& eye) const;
  void match(const FeatureWindow& window, double zoom);

  FeatureParams params_;
  RectifiedStereoCamera camera_;
  CornerDetector detector_;
  std::array<EyeImage, 2> eyes_;
  std::array<std::vector<Best>, 2> nearest_;  ///< of the corners of each eye
  std::vector<StereoFeature> features_;
  Counts counts_;
};

}  // namespace leap_object_tracker
