#pragma once

#include <opencv2/imgproc.hpp>
#include <vector>

#include "leap_object_tracker/geometry/object_model.hpp"
#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/geometry/stereo_frame.hpp"

namespace leap_object_tracker {

/// A camera with round numbers.
inline RectifiedStereoCamera roundCamera() {
  RectifiedStereoCamera camera;
  camera.focal_length = 130;
  camera.center_u = 319.5;
  camera.center_v = 239.5;
  camera.baseline = 0.04;
  camera.size = cv::Size(640, 480);
  return camera;
}

inline ObjectModel box(double x, double y, double z) {
  return makePrimitive("box", Shape::kBox, {x, y, z});
}

/// The faces of a convex mesh that look at the eye, each in a grey of its own, drawn eight times as
/// large and averaged, slightly blurred.
inline cv::Mat drawnEye(const Mesh& mesh, const Pose& camera_from_object,
                        const RectifiedStereoCamera& camera, double eye_x) {
  constexpr int kTimes = 8;
  cv::Mat large(camera.size * kTimes, CV_8UC1, cv::Scalar(4));
  Pose pose = camera_from_object;
  pose.translation().x() -= eye_x;
  for (const auto& triangle : mesh.triangles) {
    const Eigen::Vector3d a = pose * mesh.vertices[triangle[0]];
    const Eigen::Vector3d b = pose * mesh.vertices[triangle[1]];
    const Eigen::Vector3d c = pose * mesh.vertices[triangle[2]];
    const Eigen::Vector3d normal = (b - a).cross(c - a).normalized();
    const double facing = -normal.dot(a.normalized());
    if (facing <= 0) continue;
    std::vector<cv::Point> corners;
    for (const Eigen::Vector3d& point : {a, b, c}) {
      const Eigen::Vector2d pixel = camera.leftPixel(point);
      corners.emplace_back(static_cast<int>(std::lround((pixel.x() + 0.5) * kTimes)),
                           static_cast<int>(std::lround((pixel.y() + 0.5) * kTimes)));
    }
    cv::fillConvexPoly(large, corners, cv::Scalar(30 + 170 * facing));
  }
  cv::Mat eye;
  cv::resize(large, eye, camera.size, 0, 0, cv::INTER_AREA);
  cv::GaussianBlur(eye, eye, cv::Size(3, 3), 0.6);
  return eye;
}

inline RectifiedStereoFrame drawnFrame(const ObjectModel& object, const Pose& camera_from_object,
                                       const RectifiedStereoCamera& camera, double at_seconds = 1) {
  RectifiedStereoFrame frame;
  frame.stamp = stampFromSeconds(at_seconds);
  frame.left = drawnEye(object.mesh, camera_from_object, camera, 0);
  frame.right = drawnEye(object.mesh, camera_from_object, camera, camera.baseline);
  return frame;
}

/// Turned so that three faces show.
inline Pose poseAt(double x, double y, double z) {
  Pose pose = Pose::Identity();
  pose.translation() << x, y, z;
  pose.linear() = rotationFromVector({0.5, 0.6, 0.1});
  return pose;
}

/// A body with one square side, which hides all the rest of it from the eyes; none of its turns
/// brings it upon itself.
inline ObjectModel squareFaced() {
  ObjectModel object;
  object.name = "square-faced";
  object.shape = Shape::kMesh;
  object.mesh.vertices = {{-0.02, -0.02, -0.01}, {0.02, -0.02, -0.01},  {0.02, 0.02, -0.01},
                          {-0.02, 0.02, -0.01},  {-0.01, -0.018, 0.02}, {0.004, -0.018, 0.02},
                          {0.004, 0.006, 0.02},  {-0.01, 0.006, 0.02}};
  const auto side = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    object.mesh.triangles.push_back({a, b, c});
    object.mesh.triangles.push_back({a, c, d});
  };
  side(0, 3, 2, 1);
  side(4, 5, 6, 7);
  side(0, 1, 5, 4);
  side(1, 2, 6, 5);
  side(2, 3, 7, 6);
  side(3, 0, 4, 7);
  return object;
}

/// Its square side looks at the eyes.
inline Pose facing() {
  Pose pose = Pose::Identity();
  pose.translation() << 0.02, 0.003, 0.12;
  return pose;
}

/// Aslant beside the axis: three sides of a box show.
inline Pose aslant() {
  Pose pose = poseAt(0.02, 0, 0.16);
  pose.linear() = rotationFromVector({0.35, 0.3, 0.2});
  return pose;
}

}  // namespace leap_object_tracker
