#include "leap_object_tracker/evaluation/fisher_bound.hpp"

#include <cmath>

namespace leap_object_tracker {
namespace {

/// Raw pixel of a point in the eye's rectified frame; not finite where the lens has no answer.
Eigen::Vector2d rawPixel(const CameraCalibration& eye, const Eigen::Vector3d& point_in_eye) {
  const Eigen::Vector3d ray = eye.rectified_from_raw.transpose() * point_in_eye;
  if (!(ray.z() > 0)) return Eigen::Vector2d::Constant(std::nan(""));
  return pixelFromRay(eye, ray.hnormalized());
}

Eigen::Matrix3d crossMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

}  // namespace

Matrix6d lineInformation(const StereoCalibration& calibration, int eye,
                         const Pose& camera_from_object, const std::vector<LineElement>& lines,
                         const EdgeNoise& noise) {
  const CameraCalibration& camera = eye == 0 ? calibration.left : calibration.right;
  const Eigen::Vector3d eye_place(eye == 0 ? 0 : calibration.baseline, 0, 0);
  Matrix6d information = Matrix6d::Zero();
  for (const LineElement& line : lines) {
    const Eigen::Vector3d arm = camera_from_object.linear() * line.position;
    const Eigen::Vector3d at = camera_from_object.translation() + arm - eye_place;
    const Eigen::Vector2d pixel = rawPixel(camera, at);
    if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= camera.size.width - 1 &&
          pixel.y() <= camera.size.height - 1))
      continue;
    Eigen::Matrix<double, 2, 3> projection;  // [px/m]
    const double step = 1e-3 * at.norm();
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d shift = step * Eigen::Vector3d::Unit(axis);
      projection.col(axis) =
          (rawPixel(camera, at + shift) - rawPixel(camera, at - shift)) / (2 * step);
    }
    if (!projection.allFinite()) continue;
    const Eigen::Vector2d along = projection * (camera_from_object.linear() * line.tangent);
    const double stretch = along.norm();
    if (!(stretch > 0)) continue;
    const Eigen::RowVector2d normal(-along.y() / stretch, along.x() / stretch);
    Eigen::Matrix<double, 1, 6> row;
    row.head<3>() = normal * projection;
    row.tail<3>() = -row.head<3>() * crossMatrix(arm);
    const double measurements = stretch * line.length / noise.correlation_length;
    information += measurements / (noise.sigma * noise.sigma) * row.transpose() * row;
  }
  return information;
}

std::optional<PoseBound> boundFrom(const Matrix6d& information, const Pose& camera_from_object,
                                   const Symmetry& symmetry) {
  Eigen::MatrixXd directions = Matrix6d::Identity();
  if (symmetry.hasFreeAxis()) {
    const Eigen::Vector3d axis = (camera_from_object.linear() * symmetry.free_axis).normalized();
    const Eigen::Vector3d first = axis.unitOrthogonal();
    directions = Eigen::MatrixXd::Zero(6, 5);
    directions.topLeftCorner<3, 3>().setIdentity();
    directions.block<3, 1>(3, 3) = first;
    directions.block<3, 1>(3, 4) = axis.cross(first);
  }
  // Unit lengths of about a centimetre keep the matrix well conditioned.
  Matrix6d scale = Matrix6d::Identity();
  scale.topLeftCorner<3, 3>() *= 0.01;
  const Eigen::MatrixXd scaled = directions.transpose() * scale * information * scale * directions;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(scaled);
  if (solver.info() != Eigen::Success ||
      !(solver.eigenvalues().minCoeff() > 1e-9 * solver.eigenvalues().maxCoeff()))
    return std::nullopt;
  const Eigen::MatrixXd covariance = solver.eigenvectors() *
                                     solver.eigenvalues().cwiseInverse().asDiagonal() *
                                     solver.eigenvectors().transpose();
  PoseBound bound;
  bound.position = 0.01 * std::sqrt(covariance.topLeftCorner<3, 3>().trace());
  bound.orientation = std::sqrt(covariance.diagonal().tail(covariance.rows() - 3).sum());
  return bound;
}

}  // namespace leap_object_tracker
