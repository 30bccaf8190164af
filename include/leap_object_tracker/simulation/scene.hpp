#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "leap_object_tracker/geometry/object_model.hpp"
#include "leap_object_tracker/simulation/leap_lens.hpp"
#include "leap_object_tracker/simulation/motion_script.hpp"
#include "leap_object_tracker/simulation/paint.hpp"

namespace leap_object_tracker {

/// A rigid thing of the scene.
struct SceneBody {
  enum class Parent { kScene, kObject };

  std::string name;
  bool is_object = false;  ///< comes from an object file: something that may be tracked
  Mesh mesh;
  Paint paint;
  MotionScript motion;
  Parent parent = Parent::kScene;
  double edge_radius = 2e-4;  ///< [m] of rounded edges; unless the body is convex, in shading only
};

/// When frames are taken.
enum class FrameTiming {
  kSteady,  ///< the rate of the mode, with 0.3 ms of jitter
  kThesis,  ///< 39 Hz on average, standard deviation 12.8 Hz, at least 14 ms apart
};

struct LightParams {
  double power = 0.0043;       ///< [1/us at 1 m] counts of white paint, one LED, gain 1
  double ambient = 0.004;      ///< [1/us] counts of white paint, gain 1
  double lobe_exponent = 0.8;  ///< an LED sends cos^n of the angle from its axis
};

/// What the host may set on a Leap, in its own units.
struct SensorControls {
  double exposure_us = 200;
  int gain = 16;         ///< [1/16] 16 to 63
  int digital_gain = 4;  ///< [1/4] 4 to 15
  bool gamma = false;    ///< square-root response
  std::array<bool, 3> leds{true, true, true};
  int dark_interval = 0;  ///< 0 never dark, 1 always, n every n-th frame
};

struct SensorParams {
  bool auto_exposure = true;
  double full_well = 9000;      ///< [e-] at 255 counts and gain 1
  double read_noise = 1.2;      ///< [counts] at gain 1, one row
  double fixed_noise = 0.3;     ///< [counts] the same in every frame
  double dark_offset = 2.5;     ///< [counts]
  double lens_blur = 0.5;       ///< [px of the 480-row grid] standard deviation
  double vignetting = 1.5;      ///< falls off with cos^n of the angle from the axis
  double glow = 0.05;           ///< [counts/us] stray light of the LEDs at the side borders
  double pulse_limit_us = 511;  ///< longest exposure of the automatic control
};

/// All that a simulated sequence is made of. The parent of all is the scene frame: at rest it is
/// the left rectified optical frame (x right, y down, z forward).
struct Scene {
  std::string name;
  std::uint64_t seed = 1;
  int frames = 200;
  LeapUnit unit;
  SensorMode mode;
  FrameTiming timing = FrameTiming::kSteady;
  LightParams light;
  SensorParams sensor;
  SensorControls controls;  ///< at the start
  ObjectModel object;
  std::string object_path;
  std::vector<SceneBody> bodies;  ///< the first one is the object
  MotionScript camera_motion;     ///< scene_from_camera
  int samples = 32;               ///< rays for a pixel on an edge; a quarter on texture
};

/// What may be said differently from the file.
struct SceneOverrides {
  std::string object_path;  ///< empty: as the file says
  int frames = 0;           ///< 0: as the file says
  bool has_seed = false;
  std::uint64_t seed = 0;
};

/// Reads a scene file (config/scenes/README.md). Paths in it are relative to the file.
/// @throw std::runtime_error naming the file, the key and what is allowed.
Scene loadScene(const std::string& path, const SceneOverrides& overrides = {});

}  // namespace leap_object_tracker
