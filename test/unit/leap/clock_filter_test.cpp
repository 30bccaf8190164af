#include "leap_object_tracker/leap/clock_filter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace leap_object_tracker {
namespace {

constexpr double kPeriod = 0.00888;  // [s] as measured on a real unit
constexpr double kNominalPeriod = 1 / 115.0;

struct Errors {
  double rms = 0;
  double largest = 0;
  double mean = 0;
};

/// Feeds `seconds` of frames; delays are exponential with rare long ones. Errors after `settled`.
Errors run(ClockFilter& filter, double seconds, double settled, double mean_delay, double drift,
           double first_ms = 1000, double host_start = 50) {
  std::mt19937 random(3);
  std::exponential_distribution<double> delay(1 / mean_delay);
  Errors errors;
  int count = 0;
  for (int i = 0; i * kPeriod < seconds; ++i) {
    const double device = first_ms / 1000 + i * kPeriod;  // [s]
    const double host = host_start + i * kPeriod * (1 + drift);
    const double late = delay(random) + (random() % 50 == 0 ? 0.015 : 0);
    const auto ms = static_cast<std::uint32_t>(static_cast<std::uint64_t>(device * 1000));
    const double error = filter.push(ms, host + late) - host;
    if (i * kPeriod < settled) continue;
    errors.rms += error * error;
    errors.mean += error;
    errors.largest = std::max(errors.largest, std::abs(error));
    ++count;
  }
  errors.rms = std::sqrt(errors.rms / count);
  errors.mean /= count;
  return errors;
}

TEST(ClockFilter, findsTheStartOfFramesThatArriveLate) {
  ClockFilter filter(kNominalPeriod);
  const Errors errors = run(filter, 30, 5, 0.0005, 0);
  EXPECT_LT(errors.rms, 0.00012);
  EXPECT_LT(errors.largest, 0.0005);
}

TEST(ClockFilter, followsADeviceClockThatDrifts) {
  ClockFilter filter(kNominalPeriod);
  const Errors errors = run(filter, 60, 10, 0.0005, 100e-6);
  EXPECT_LT(errors.rms, 0.00015);
  EXPECT_NEAR(100e-6, filter.drift(), 40e-6);
}

TEST(ClockFilter, measuresThePeriod) {
  ClockFilter filter(kNominalPeriod);
  run(filter, 10, 0, 0.0003, 0);
  EXPECT_NEAR(kPeriod, filter.period(), 2e-6);
}

TEST(ClockFilter, beginsAnewWhenTheDeviceRestarts) {
  ClockFilter filter(kNominalPeriod);
  run(filter, 5, 0, 0.0003, 0, 250000, 50);
  const Errors errors = run(filter, 10, 3, 0.0003, 0, 0, 60);
  EXPECT_LT(errors.largest, 0.0006);
}

TEST(ClockFilter, doesNotMindTheWrapOfTheDeviceClock) {
  ClockFilter filter(kNominalPeriod);
  const Errors errors = run(filter, 20, 5, 0.0003, 0, 4294967296.0 - 10000, 50);
  EXPECT_LT(errors.largest, 0.0005);
}

TEST(ClockFilter, followsALongerExposureThatSlowsTheFrames) {
  ClockFilter filter(kNominalPeriod);
  double host = 10, last = 0;
  for (int i = 0; i < 600; ++i) {
    host += i < 300 ? kPeriod : 0.0125;
    const double begin = filter.push(static_cast<std::uint32_t>(host * 1000), host);
    EXPECT_TRUE(i <= 500 || std::abs(host - begin) < 0.001) << i;
    EXPECT_GT(begin, last);
    last = begin;
  }
}

}  // namespace
}  // namespace leap_object_tracker
