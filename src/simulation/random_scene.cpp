#include "leap_object_tracker/simulation/random_scene.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "leap_object_tracker/simulation/leap_sensor.hpp"

namespace leap_object_tracker {
namespace {

using Eigen::Vector3d;

constexpr int kSurfacePoints = 400;
constexpr double kGap = 0.003;  // [m] between the object and other bodies

Eigen::Matrix3d turnDegrees(double x, double y, double z) {
  return rotationFromVector({0, 0, z * M_PI / 180}) * rotationFromVector({0, y * M_PI / 180, 0}) *
         rotationFromVector({x * M_PI / 180, 0, 0});
}

/// Even over SO(3) (Shoemake 1992).
Eigen::Matrix3d randomTurn(HashRandom& random) {
  const double share = random.uniform(), a = random.uniform(0, 2 * M_PI),
               b = random.uniform(0, 2 * M_PI);
  return Eigen::Quaterniond(std::sqrt(share) * std::cos(b), std::sqrt(1 - share) * std::sin(a),
                            std::sqrt(1 - share) * std::cos(a), std::sqrt(share) * std::sin(b))
      .normalized()
      .toRotationMatrix();
}

Paint texture(HashRandom& random, double scale) {
  constexpr std::array<PaintKind, 4> kKinds{PaintKind::kChecker, PaintKind::kStripes,
                                            PaintKind::kNoise, PaintKind::kBlobs};
  Paint paint;
  paint.kind = kKinds[static_cast<std::size_t>(random.uniform() * kKinds.size())];
  paint.albedo_low = random.uniform(0.05, 0.25);
  paint.albedo_high = random.uniform(0.5, 0.8);
  paint.scale = scale * random.uniform(0.6, 1.6);
  paint.gloss = 0.02;
  paint.seed = random.bits();
  return paint;
}

Paint plain(double albedo) {
  Paint paint;
  paint.albedo_high = albedo;
  return paint;
}

SceneBody bodyAt(const std::string& name, const Mesh& mesh, const Paint& paint,
                 const Vector3d& position, const Eigen::Matrix3d& turn) {
  SceneBody body;
  body.name = name;
  body.mesh = mesh;
  body.paint = paint;
  body.motion.rest.translation() = position;
  body.motion.rest.linear() = turn;
  return body;
}

SceneBody wall(HashRandom& random, double scale, double nearest, double farthest) {
  Paint paint = texture(random, scale);
  paint.gloss = 0;
  return bodyAt("wall", makeBox({3, 3, 0.02}), paint, {0, 0, random.uniform(nearest, farthest)},
                turnDegrees(random.uniform(-10, 10), random.uniform(-15, 15), 0));
}

Surroundings drawSurroundings(HashRandom& random) {
  const double share = random.uniform();
  if (share < 0.6) return Surroundings::kDarkWall;
  if (share < 0.75) return Surroundings::kBoard;
  if (share < 0.85) return Surroundings::kTable;
  return Surroundings::kDistractor;
}

/// A shape that the object does not have, about as large.
Mesh otherShape(const ObjectModel& object, HashRandom& random) {
  const double length = 0.6 * diameterOf(object.mesh) * random.uniform(0.8, 1.3);
  if (object.shape != Shape::kCylinder && random.uniform() < 0.5)
    return makeCylinder(0.3 * length, length);
  if (object.shape != Shape::kPrism) return makePrism(0.8 * length, 0.9 * length);
  return makeBox({0.5 * length, 0.7 * length, length});
}

void addTable(std::vector<SceneBody>& bodies, HashRandom& random) {
  const double top = random.uniform(0.07, 0.12);  // [m] below the camera
  bodies.push_back(bodyAt("table", makeBox({1.2, 0.02, 0.9}), texture(random, 0.03),
                          {0, top + 0.01, 0.45}, Eigen::Matrix3d::Identity()));
  const auto place = [&](double x) {
    return Vector3d(x + random.uniform(-0.03, 0.03), 0, random.uniform(0.2, 0.4));
  };
  const double height = random.uniform(0.06, 0.14);
  bodies.push_back(bodyAt("carton", makeBox({0.07, height, 0.06}), texture(random, 0.02),
                          place(0.14) + Vector3d(0, top - height / 2, 0),
                          turnDegrees(0, random.uniform(0, 90), 0)));
  bodies.push_back(bodyAt("can", makeCylinder(0.033, 0.1), texture(random, 0.025),
                          place(-0.12) + Vector3d(0, top - 0.05, 0), turnDegrees(90, 0, 0)));
  bodies.push_back(bodyAt("book", makeBox({0.16, 0.03, 0.11}), texture(random, 0.02),
                          place(0) + Vector3d(0, top - 0.015, 0),
                          turnDegrees(0, random.uniform(-40, 40), 0)));
}

bool isInside(const Eigen::Vector2d& pixel, int width, int height) {
  return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= width - 1 && pixel.y() <= height - 1;
}

}  // namespace

std::string wordFrom(Surroundings surroundings) {
  switch (surroundings) {
    case Surroundings::kDarkWall:
      return "dark wall";
    case Surroundings::kBoard:
      return "textured board";
    case Surroundings::kTable:
      return "table";
    case Surroundings::kDistractor:
      break;
  }
  return "distractor";
}

RandomScene randomScene(const ObjectModel& object, const std::string& calibration,
                        std::uint64_t seed) {
  HashRandom random(seed, 0);
  RandomScene result;
  Scene& scene = result.scene;
  scene.name = "random";
  scene.seed = seed;
  scene.unit = loadLeapUnit(calibration);
  scene.mode = sensorMode("640x240");
  scene.timing = FrameTiming::kThesis;
  scene.samples = 16;
  scene.light.ambient = std::exp(random.uniform(std::log(0.001), std::log(0.012)));
  scene.object = object;

  const Paint paint = random.uniform() < 0.5 ? plain(random.uniform(0.35, 0.8))
                                             : texture(random, 0.25 * diameterOf(object.mesh));
  scene.bodies.push_back(
      bodyAt(object.name, object.mesh, paint, Vector3d::Zero(), Eigen::Matrix3d::Identity()));
  scene.bodies.front().is_object = true;

  result.surroundings = drawSurroundings(random);
  switch (result.surroundings) {
    case Surroundings::kDarkWall:
      scene.bodies.push_back(wall(random, 0.15, 0.7, 1.5));
      break;
    case Surroundings::kBoard:
      scene.bodies.push_back(wall(random, 0.03, 0.4, 0.7));
      break;
    case Surroundings::kTable:
      scene.bodies.push_back(wall(random, 0.12, 0.7, 1.0));
      addTable(scene.bodies, random);
      break;
    case Surroundings::kDistractor:
      scene.bodies.push_back(wall(random, 0.15, 0.7, 1.5));
      const double depth = random.uniform(0.10, 0.25);
      scene.bodies.push_back(bodyAt(
          "distractor", otherShape(object, random),
          random.uniform() < 0.5 ? plain(random.uniform(0.35, 0.8)) : texture(random, 0.01),
          {0.02 + depth * random.uniform(-0.7, 0.7), depth * random.uniform(-0.4, 0.4), depth},
          randomTurn(random)));
      break;
  }
  return result;
}

RandomPlacement::RandomPlacement(const Scene& scene, const RectifiedStereoCamera& camera,
                                 const PlacementRange& range)
    : range_(range),
      camera_(camera),
      lenses_{LeapLens(scene.unit.left, scene.mode), LeapLens(scene.unit.right, scene.mode)} {
  const auto boundsOf = [](const Mesh& mesh, Vector3d& low, Vector3d& high) {
    low = high = mesh.vertices.front();
    for (const auto& vertex : mesh.vertices) {
      low = low.cwiseMin(vertex);
      high = high.cwiseMax(vertex);
    }
  };
  const Mesh& mesh = scene.bodies.front().mesh;
  boundsOf(mesh, low_, high_);
  for (std::size_t i = 1; i < scene.bodies.size(); ++i) {
    Box box{scene.bodies[i].motion.at(0), {}, {}};
    boundsOf(scene.bodies[i].mesh, box.low, box.high);
    others_.push_back(box);
  }

  std::vector<double> area_up_to;
  double area = 0;
  const auto cornersOf = [&](std::size_t triangle) {
    const auto& t = mesh.triangles[triangle];
    return std::array<Vector3d, 3>{mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
  };
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto [a, b, c] = cornersOf(t);
    area_up_to.push_back(area += (b - a).cross(c - a).norm());
  }
  HashRandom random(1);
  for (int i = 0; i < kSurfacePoints; ++i) {
    const double at = area * (i + 0.5) / kSurfacePoints;
    const auto found = std::upper_bound(area_up_to.begin(), area_up_to.end() - 1, at);
    const auto [a, b, c] = cornersOf(static_cast<std::size_t>(found - area_up_to.begin()));
    double u = random.uniform(), v = random.uniform();
    if (u + v > 1) u = 1 - u, v = 1 - v;
    surface_.push_back({a + u * (b - a) + v * (c - a), (b - a).cross(c - a).normalized()});
  }
}

double RandomPlacement::shareInImages(const Pose& camera_from_object, int eye) const {
  const LeapLens& lens = lenses_[static_cast<std::size_t>(eye)];
  const Vector3d origin(eye == 0 ? 0 : camera_.baseline, 0, 0);
  int facing = 0, inside = 0;
  for (const auto& [point, normal] : surface_) {
    const Vector3d in_eye = camera_from_object * point - origin;
    if ((camera_from_object.linear() * normal).dot(in_eye) >= 0) continue;
    ++facing;
    if (!(in_eye.z() > 0)) continue;
    const SensorMode& mode = lens.mode();
    if (isInside(lens.pixel(in_eye), mode.width, mode.height) &&
        isInside(camera_.leftPixel(in_eye), camera_.size.width, camera_.size.height))
      ++inside;
  }
  return facing > 0 ? static_cast<double>(inside) / facing : 0;
}

bool RandomPlacement::fits(const Pose& camera_from_object) const {
  for (const auto& [point, normal] : surface_) {
    const Vector3d at = camera_from_object * point;
    if (at.z() < 0.5 * range_.least_distance || at.norm() < range_.least_distance ||
        (at - Vector3d(camera_.baseline, 0, 0)).norm() < range_.least_distance)
      return false;
    for (const Box& box : others_) {
      const Vector3d in_body = box.scene_from_body.inverse() * at;
      if ((in_body.array() > box.low.array() - kGap).all() &&
          (in_body.array() < box.high.array() + kGap).all())
        return false;
    }
  }
  for (const Box& box : others_)
    for (int corner = 0; corner < 8; ++corner) {
      const Vector3d in_body((corner & 1) != 0 ? box.high.x() : box.low.x(),
                             (corner & 2) != 0 ? box.high.y() : box.low.y(),
                             (corner & 4) != 0 ? box.high.z() : box.low.z());
      const Vector3d at = camera_from_object.inverse() * (box.scene_from_body * in_body);
      if ((at.array() > low_.array()).all() && (at.array() < high_.array()).all()) return false;
    }
  return shareInImages(camera_from_object, 0) >= range_.least_visible &&
         shareInImages(camera_from_object, 1) >= range_.least_visible;
}

MotionScript RandomPlacement::draw(HashRandom& random) const {
  constexpr int kDepths = 200, kTries = 40;
  const SensorMode& mode = lenses_[0].mode();
  for (int i = 0; i < kDepths; ++i) {
    const double depth =
        range_.uniform
            ? random.uniform(range_.nearest, range_.farthest)
            : std::exp(random.uniform(std::log(range_.nearest), std::log(range_.farthest)));
    for (int k = 0; k < kTries; ++k) {
      const Vector3d ray =
          lenses_[0].ray(random.uniform(0, mode.width - 1.0), random.uniform(0, mode.height - 1.0));
      MotionScript motion;
      motion.rest.linear() = randomTurn(random);
      if (!(ray.z() > 0.05 * ray.norm())) continue;
      motion.rest.translation() = ray * (depth / ray.z());
      const Vector3d from_middle = motion.rest.translation() - Vector3d(camera_.baseline / 2, 0, 0);
      if (std::atan2(from_middle.head<2>().norm(), from_middle.z()) > range_.widest) continue;
      if (!fits(motion.rest)) continue;
      if (random.uniform() < 0.5) {
        MotionScript::Wobble wobble;
        wobble.amplitude.setConstant(0.004);
        wobble.angular_amplitude.setConstant(4 * M_PI / 180);
        wobble.period = random.uniform(0.7, 2);
        for (double& phase : wobble.phases) phase = random.uniform(0, 2 * M_PI);
        motion.wobbles.push_back(wobble);
      }
      return motion;
    }
  }
  throw std::runtime_error("random placement: the object fits nowhere between " +
                           std::to_string(range_.nearest) + " and " +
                           std::to_string(range_.farthest) + " m");
}

SensorControls randomControls(const RawStereoFrame& frame, const SensorControls& taken_with,
                              double longest_exposure_us, HashRandom& random) {
  constexpr double kTarget = 190;  // [counts]
  const double factor = std::exp(random.uniform(std::log(0.5), std::log(1.3)));
  const double brightest = std::max(4.0, brightestOf(frame.left, frame.right));
  return brighter(taken_with, factor * kTarget / brightest, longest_exposure_us);
}

}  // namespace leap_object_tracker
