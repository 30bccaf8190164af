#pragma once

#include <memory>
#include <mutex>
#include <utility>

#include "emulated_leap.hpp"
#include "leap_object_tracker/simulation/simulator.hpp"

namespace leap_object_tracker {

/// Lets an emulated Leap see what the simulator renders, with the settings that the host sent.
class SimulatedPicture {
 public:
  explicit SimulatedPicture(const Scene& scene) { show(scene); }

  /// From the next frame on.
  void show(const Scene& scene) {
    auto simulator = std::make_shared<Simulator>(scene);
    const std::lock_guard<std::mutex> lock(mutex_);
    simulator_ = std::move(simulator);
  }

  /// To be given to EmulatedLeap::setPicture; this object must outlive the device.
  EmulatedLeap::Picture picture() {
    return [this](const EmulatedLeap::Frame& frame, std::uint8_t* interleaved) {
      const std::lock_guard<std::mutex> lock(mutex_);
      simulator_->setControls(controlsOf(frame));
      auto seen = simulator_->next();
      if (!seen) {
        simulator_->rewind();
        seen = simulator_->next();
      }
      truth_[frame.index % kRemembered] = *seen;
      const std::size_t pixels = seen->raw.left.total();
      for (std::size_t i = 0; i < pixels; ++i) {
        interleaved[2 * i] = seen->raw.left.data[i];
        interleaved[2 * i + 1] = seen->raw.right.data[i];
      }
    };
  }

  /// What one of the latest frames showed.
  SimulatedFrame truth(std::uint32_t frame) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return truth_[frame % kRemembered];
  }

 private:
  static constexpr std::size_t kRemembered = 256;

  static SensorControls controlsOf(const EmulatedLeap::Frame& frame) {
    SensorControls controls;
    controls.exposure_us = frame.settings.exposure_us;
    controls.gain = frame.settings.analog_gain;
    controls.digital_gain = frame.settings.digital_gain;
    controls.gamma = frame.settings.gamma;
    for (std::size_t i = 0; i < 3; ++i)
      controls.leds[i] = frame.lit && frame.settings.led[static_cast<int>(i)];
    return controls;
  }

  mutable std::mutex mutex_;
  std::shared_ptr<Simulator> simulator_;
  std::array<SimulatedFrame, kRemembered> truth_;
};

}  // namespace leap_object_tracker
