#pragma once

#include <cstdint>
#include <deque>
#include <optional>

namespace leap_object_tracker {

/// Finds when frames began on the host's clock, from the device's clock of whole milliseconds and
/// from arrival times that are only ever late.
///
/// First the device's clock is made finer: frames come at a steady period, so each reading narrows
/// down where in its millisecond it was. Then the line below all (device time, delay) points of the
/// last seconds gives offset and drift (Moon, Skelly and Towsley 1999, "Estimation and removal of
/// clock skew from network delay measurements").
class ClockFilter {
 public:
  /// @param period expected time between frames [s]
  explicit ClockFilter(double period);

  /// @param device_ms device clock [ms], may wrap or start again
  /// @param arrival host clock [s]
  /// @return the arrival that a frame without any delay would have had [s]
  double push(std::uint32_t device_ms, double arrival);

  /// Measured time between frames [s].
  double period() const { return period_; }
  /// How much faster the host's clock runs, as a share.
  double drift() const { return drift_; }

 private:
  struct Point {
    double device;  ///< [s]
    double offset;  ///< arrival - device [s]
  };
  void restart(std::uint32_t device_ms, double arrival);
  void refine(std::uint32_t device_ms);
  void remember(const Point& point);
  double offsetAt(double device);

  double period_;  ///< [s]
  bool started_ = false;
  std::uint32_t last_ms_ = 0;
  double reading_ = 0;       ///< device clock without wraps [s]
  double device_ = 0;        ///< the same, finer [s]
  double last_arrival_ = 0;  ///< [s]
  double drift_ = 0;
  double segment_start_ = 0;    ///< [s]
  std::deque<Point> earliest_;  ///< the least late point of each segment
};

}  // namespace leap_object_tracker
