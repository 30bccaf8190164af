#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/geometry/stereo_frame.hpp"
#include "leap_object_tracker/simulation/hash_random.hpp"
#include "leap_object_tracker/simulation/scene.hpp"

namespace leap_object_tracker {

/// What stands round an object.
enum class Surroundings {
  kDarkWall,    ///< a wall at 0.7 to 1.5 m
  kBoard,       ///< a textured board at 0.4 to 0.7 m
  kTable,       ///< a textured table below, things on it, a textured wall
  kDistractor,  ///< something of another shape and about the same size before the dark wall
};
std::string wordFrom(Surroundings surroundings);

/// A scene with an object whose paint, surroundings, ambient light and wall are drawn at random;
/// six of ten stand before a dark wall. The object is not placed yet. Nothing but the object moves.
/// @param calibration a file of config/calibration
struct RandomScene {
  Scene scene;
  Surroundings surroundings = Surroundings::kDarkWall;
};
RandomScene randomScene(const ObjectModel& object, const std::string& calibration,
                        std::uint64_t seed);

struct PlacementRange {
  double nearest = 0.04;         ///< [m] depth of the object's origin
  double farthest = 0.30;        ///< [m]
  bool uniform = false;          ///< depths evenly over metres, else over their logarithm
  double widest = M_PI / 2;      ///< [rad] off the axis of the pair, seen from between the eyes
  double least_visible = 0.7;    ///< share of the side facing each eye that lies inside its images
  double least_distance = 0.02;  ///< [m] from each eye to the surface
};

/// Draws places for the first body of a scene, evenly over the left image and thus about evenly
/// over all directions: in both images, raw and rectified, not inside of other bodies and not too
/// near. What other bodies hide is left to the renderer.
class RandomPlacement {
 public:
  RandomPlacement(const Scene& scene, const RectifiedStereoCamera& camera,
                  const PlacementRange& range);

  /// Half of the motions are at rest, the others wobble by some millimetres and degrees.
  /// @throw std::runtime_error if the object fits nowhere.
  MotionScript draw(HashRandom& random) const;

  /// Share of the side facing an eye that lies inside of its images, 0 to 1.
  double shareInImages(const Pose& camera_from_object, int eye) const;

 private:
  struct SurfacePoint {
    Eigen::Vector3d point, normal;
  };
  struct Box {
    Pose scene_from_body;
    Eigen::Vector3d low, high;  ///< [m] in the body's frame
  };

  bool fits(const Pose& camera_from_object) const;

  PlacementRange range_;
  RectifiedStereoCamera camera_;
  std::array<LeapLens, 2> lenses_;
  std::vector<SurfacePoint> surface_;
  Eigen::Vector3d low_, high_;  ///< [m] of the object
  std::vector<Box> others_;
};

/// Controls that make the brightest things of a frame about as bright as a host wants them, off by
/// a random factor of 0.5 to 1.3.
SensorControls randomControls(const RawStereoFrame& frame, const SensorControls& taken_with,
                              double longest_exposure_us, HashRandom& random);

}  // namespace leap_object_tracker
