#include <visp3/core/vpCameraParameters.h>
#include <visp3/core/vpException.h>
#include <visp3/core/vpHomogeneousMatrix.h>
#include <visp3/core/vpImage.h>
#include <visp3/mbt/vpMbGenericTracker.h>
#include <visp3/me/vpMe.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <map>

#include "command_line.hpp"
#include "leap_object_tracker/evaluation/trajectory.hpp"
#include "leap_object_tracker/geometry/object_model.hpp"
#include "leap_object_tracker/rectification/stereo_rectifier.hpp"
#include "stereo_bag.hpp"

namespace leap_object_tracker {
namespace {

namespace fs = std::filesystem;

constexpr const char* kUsage =
    R"(usage: visp_track_bag BAG --object FILE.yaml --out POSES.tum [options]

Tracks a box, prism or cylinder through a bag with ViSP's stereo model-based tracker (moving edges,
vpMbGenericTracker), from the true start pose, on the same rectified images as track_bag.

  --timing FILE.csv  stamp, state and milliseconds of every pair
  --helped           puts the tracker back on the truth after every frame that is off by more than
                     10 mm or 10 deg; such a frame has no pose
  --every N          takes only the first of every N pairs
  --range PX         of the first search along the normals (16); 0: no first search
  --fine PX          of the second search, edges laid anew at the pose (4)
  --threshold T      of the contrast, ViSP's unit (2000)
  --step PX          between edge sites (4)
  --mask N           size of the convolution masks (5)
  --angle DEG        faces whose normal is farther from the view are not used (72)
  --good SHARE       of the sites that must be found (0.2)
)";

const std::map<std::string, int> kOptions{
    {"object", 1}, {"out", 1},  {"timing", 1},    {"helped", 0}, {"every", 1},
    {"range", 1},  {"fine", 1}, {"threshold", 1}, {"step", 1},   {"mask", 1},
    {"angle", 1},  {"good", 1}, {"help", 0}};

struct Settings {
  unsigned range = 16, fine = 4, mask = 5;
  double threshold = 2000, step = 4, angle = 72, good = 0.2;
};

Settings readSettings(const CommandLine& line) {
  Settings s;
  if (line.has("range")) s.range = static_cast<unsigned>(line.wholeNumber("range", 0, 100));
  if (line.has("fine")) s.fine = static_cast<unsigned>(line.wholeNumber("fine", 1, 100));
  if (line.has("mask")) s.mask = static_cast<unsigned>(line.wholeNumber("mask", 3, 15));
  if (line.has("threshold")) s.threshold = line.number("threshold", 0, 0, 1e9);
  if (line.has("step")) s.step = line.number("step", 0, 0.5, 100);
  if (line.has("angle")) s.angle = line.number("angle", 0, 1, 90);
  if (line.has("good")) s.good = line.number("good", 0, 0, 1);
  return s;
}

/// Outlines of the faces, counter-clockwise seen from outside, into the vertices of the mesh:
/// triangles of one plane joined.
std::vector<std::vector<std::uint32_t>> facesOf(const Mesh& mesh) {
  struct Plane {
    Eigen::Vector3d normal;
    double offset;
    std::vector<std::uint32_t> corners;
  };
  std::vector<Plane> planes;
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3d& a = mesh.vertices[t[0]];
    const Eigen::Vector3d normal =
        (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a).normalized();
    auto plane = std::find_if(planes.begin(), planes.end(), [&](const Plane& p) {
      return p.normal.dot(normal) > 1 - 1e-9 && std::abs(p.offset - normal.dot(a)) < 1e-9;
    });
    if (plane == planes.end()) plane = planes.insert(plane, {normal, normal.dot(a), {}});
    for (const auto corner : t)
      if (std::count(plane->corners.begin(), plane->corners.end(), corner) == 0)
        plane->corners.push_back(corner);
  }
  std::vector<std::vector<std::uint32_t>> faces;
  for (Plane& plane : planes) {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const auto corner : plane.corners)
      middle += mesh.vertices[corner] / static_cast<double>(plane.corners.size());
    const Eigen::Vector3d first = (mesh.vertices[plane.corners[0]] - middle).normalized();
    const Eigen::Vector3d second = plane.normal.cross(first);
    const auto angle = [&](std::uint32_t corner) {
      const Eigen::Vector3d arm = mesh.vertices[corner] - middle;
      return std::atan2(arm.dot(second), arm.dot(first));
    };
    std::sort(plane.corners.begin(), plane.corners.end(),
              [&](auto a, auto b) { return angle(a) < angle(b); });
    faces.push_back(plane.corners);
  }
  return faces;
}

/// The object in ViSP's own format.
void writeCao(const ObjectModel& object, const std::string& path) {
  std::ofstream out(path);
  const auto write = [&](const Eigen::Vector3d& p) {
    out << p.x() << ' ' << p.y() << ' ' << p.z() << '\n';
  };
  out << "V1\n" << std::setprecision(9);
  if (object.shape == Shape::kCylinder) {
    const double radius = object.size.x(), half = object.size.y() / 2;
    // Axis, then a centre and two points of each rim, clockwise seen from outside: so that
    // ViSP takes them for visible from there.
    const std::vector<Eigen::Vector3d> points{{0, 0, -half},      {0, 0, half},
                                              {radius, 0, half},  {0, radius, half},
                                              {0, radius, -half}, {radius, 0, -half}};
    out << points.size() << '\n';
    for (const auto& point : points) write(point);
    out << "0\n0\n0\n1\n0 1 " << radius << "\n2\n" << radius << " 1 3 2\n" << radius << " 0 5 4\n";
    return;
  }
  if (object.shape == Shape::kMesh)
    throw std::runtime_error("object '" + object.name + "': only boxes, prisms and cylinders");
  out << object.mesh.vertices.size() << '\n';
  for (const auto& vertex : object.mesh.vertices) write(vertex);
  const auto faces = facesOf(object.mesh);
  out << "0\n0\n" << faces.size() << '\n';
  for (const auto& face : faces) {
    out << face.size();
    for (const auto corner : face) out << ' ' << corner;
    out << '\n';
  }
  out << "0\n0\n";
}

vpHomogeneousMatrix matrixFrom(const Pose& pose) {
  vpHomogeneousMatrix m;
  for (unsigned i = 0; i < 3; ++i)
    for (unsigned j = 0; j < 4; ++j) m[i][j] = pose.matrix()(i, j);
  return m;
}

Pose poseFrom(const vpHomogeneousMatrix& m) {
  Pose pose = Pose::Identity();
  for (unsigned i = 0; i < 3; ++i)
    for (unsigned j = 0; j < 4; ++j) pose.matrix()(i, j) = m[i][j];
  return normalized(pose);
}

void copy(const cv::Mat& from, vpImage<unsigned char>& to) {
  to.resize(static_cast<unsigned>(from.rows), static_cast<unsigned>(from.cols));
  for (int v = 0; v < from.rows; ++v)
    std::copy(from.ptr(v), from.ptr(v) + from.cols, to[static_cast<unsigned>(v)]);
}

class VispTracker {
 public:
  VispTracker(const Settings& settings, const RectifiedStereoCamera& camera,
              const std::string& model)
      : settings_(settings),
        tracker_(2, vpMbGenericTracker::EDGE_TRACKER),
        baseline_(camera.baseline) {
    coarse_ = movingEdges(settings.range);
    fine_ = movingEdges(settings.fine);
    tracker_.setMovingEdge(fine_, fine_);
    const vpCameraParameters parameters(camera.focal_length, camera.focal_length, camera.center_u,
                                        camera.center_v);
    tracker_.setCameraParameters(parameters, parameters);
    std::map<std::string, vpHomogeneousMatrix> transforms;
    Pose right_from_left = Pose::Identity();
    right_from_left.translation().x() = -camera.baseline;
    transforms["Camera1"] = vpHomogeneousMatrix();
    transforms["Camera2"] = matrixFrom(right_from_left);
    tracker_.setAngleAppear(vpMath::rad(settings.angle - 2), vpMath::rad(settings.angle - 2));
    tracker_.setAngleDisappear(vpMath::rad(settings.angle), vpMath::rad(settings.angle));
    tracker_.setNearClippingDistance(0.005, 0.005);
    tracker_.setFarClippingDistance(2, 2);
    tracker_.setOptimizationMethod(vpMbTracker::LEVENBERG_MARQUARDT_OPT);
    tracker_.setGoodMovingEdgesRatioThreshold(settings.good);
    tracker_.setDisplayFeatures(false);
    tracker_.loadModel(model, model);
    tracker_.setCameraTransformationMatrix(transforms);
  }

  void start(const RectifiedStereoFrame& frame, const Pose& camera_from_object) {
    copy(frame.left, left_);
    copy(frame.right, right_);
    layForNext(camera_from_object);
    pose_ = camera_from_object;
  }

  /// @return nothing if ViSP gives up on this frame; the next one begins at the last pose.
  std::optional<Pose> track(const RectifiedStereoFrame& frame) {
    copy(frame.left, left_);
    copy(frame.right, right_);
    try {
      tracker_.track(left_, right_);
      if (settings_.range > 0) {
        lay(current(), fine_);
        tracker_.track(left_, right_);
      }
      const Pose pose = current();
      if (!pose.matrix().allFinite() || !(pose.translation().z() > 0)) return recover();
      pose_ = pose;
      // The next frame looks for the edges as they are in this one.
      if (settings_.range > 0) layForNext(pose_);
      return pose_;
    } catch (const vpException&) {
      return recover();
    }
  }

 private:
  vpMe movingEdges(unsigned range) const {
    vpMe me;
    me.setMaskSize(settings_.mask);
    me.setMaskNumber(180);
    me.setRange(range);
    me.setThreshold(settings_.threshold);
    me.setMu1(0.5);
    me.setMu2(0.5);
    me.setSampleStep(settings_.step);
    return me;
  }

  Pose current() const {
    vpHomogeneousMatrix left, right;
    tracker_.getPose(left, right);
    return poseFrom(left);
  }

  void layForNext(const Pose& camera_from_object) {
    lay(camera_from_object, settings_.range > 0 ? coarse_ : fine_);
  }

  /// New edge sites at a pose.
  void lay(const Pose& camera_from_object, const vpMe& moving_edges) {
    tracker_.setMovingEdge(moving_edges, moving_edges);
    Pose right_from_object = camera_from_object;
    right_from_object.translation().x() -= baseline_;
    const vpHomogeneousMatrix left = matrixFrom(camera_from_object);
    const vpHomogeneousMatrix right = matrixFrom(right_from_object);
    if (begun_)
      tracker_.setPose(left_, right_, left, right);
    else
      tracker_.initFromPose(left_, right_, left, right);
    begun_ = true;
  }

  std::optional<Pose> recover() {
    try {
      layForNext(pose_);
    } catch (const vpException&) {
      // The next frame tries again.
    }
    return std::nullopt;
  }

  Settings settings_;
  vpMbGenericTracker tracker_;
  double baseline_;
  vpMe coarse_, fine_;
  vpImage<unsigned char> left_, right_;
  bool begun_ = false;
  Pose pose_ = Pose::Identity();
};

const StampedPose* truthAt(const Trajectory& truth, Stamp stamp) {
  using namespace std::chrono_literals;
  const auto found = std::find_if(truth.begin(), truth.end(), [&](const StampedPose& pose) {
    return std::chrono::abs(pose.stamp - stamp) < 1ms;
  });
  return found == truth.end() ? nullptr : &*found;
}

bool isOff(const Pose& pose, const Pose& truth, const Symmetry& symmetry) {
  return (pose.translation() - truth.translation()).norm() > 0.010 ||
         angleBetween(pose.linear(), truth.linear(), symmetry) > 10 * M_PI / 180;
}

int run(int argc, char** argv) {
  const CommandLine line(argc, argv, kOptions);
  if (line.has("help")) {
    std::cout << kUsage;
    return 0;
  }
  if (line.positional().size() != 1) throw UsageError("expected one BAG");
  for (const char* needed : {"object", "out"})
    if (!line.has(needed)) throw UsageError(std::string("--") + needed + " is missing");
  const Settings settings = readSettings(line);
  const long long every = line.has("every") ? line.wholeNumber("every", 1, 1000000) : 1;
  const bool helped = line.has("helped");

  const ObjectModel object = loadObject(line.text("object"));
  const std::string model = line.text("out") + ".cao";
  writeCao(object, model);
  const StereoBag bag(line.positional().front(), {}, Eyes::kBoth);
  const Trajectory truth = bag.truth();
  const StereoRectifier rectifier(bag.calibration(), rectifiedCamera(bag.calibration(), {}));
  VispTracker tracker(settings, rectifier.camera(), model);
  fs::remove(model);

  std::ofstream timing;
  if (line.has("timing")) {
    timing.open(line.text("timing"));
    timing << "stamp,state,rectification_ms,edges_ms,filter_ms,total_ms\n" << std::fixed;
  }
  Trajectory poses;
  bool started = false;
  long long pairs = 0;
  bag.forEachPair([&](const RawStereoFrame& raw) {
    if (pairs++ % every != 0) return;
    const RectifiedStereoFrame frame = rectifier.rectify(raw);
    const StampedPose* true_pose = truthAt(truth, raw.stamp);
    if (!started) {
      if (true_pose == nullptr) return;
      tracker.start(frame, true_pose->camera_from_object);
      started = true;
    }
    const auto begin = std::chrono::steady_clock::now();
    std::optional<Pose> pose = tracker.track(frame);
    const std::chrono::duration<double, std::milli> elapsed =
        std::chrono::steady_clock::now() - begin;
    if (helped && true_pose != nullptr &&
        (!pose || isOff(*pose, true_pose->camera_from_object, object.symmetry))) {
      pose.reset();
      tracker.start(frame, true_pose->camera_from_object);
    }
    if (pose) poses.push_back({raw.stamp, *pose, {}});
    if (timing.is_open())
      timing << std::setprecision(9) << seconds(raw.stamp) << ',' << (pose ? "tracking" : "lost")
             << std::setprecision(4) << ",0,0," << elapsed.count() << ',' << elapsed.count()
             << '\n';
  });
  writeTum(line.text("out"), poses);
  std::printf("frames            %lld, %zu with a pose\n", (pairs + every - 1) / every,
              poses.size());
  return 0;
}

}  // namespace
}  // namespace leap_object_tracker

int main(int argc, char** argv) {
  try {
    return leap_object_tracker::run(argc, argv);
  } catch (const leap_object_tracker::UsageError& error) {
    std::cerr << "visp_track_bag: " << error.what() << "\n\n" << leap_object_tracker::kUsage;
    return 2;
  } catch (const std::exception& error) {
    std::cerr << "visp_track_bag: " << error.what() << "\n";
    return 1;
  }
}
