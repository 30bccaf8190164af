// The device at its own rate. LEAP_TEST_SECONDS sets how long each part takes; 60 for a report.
#include <dirent.h>
#include <gtest/gtest.h>
#include <time.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <random>
#include <string>

#include "emulated_leap_bus.hpp"
#include "leap_object_tracker/leap/leap_device.hpp"

namespace leap_object_tracker {
namespace {

using std::chrono::milliseconds;

double secondsOfTest() {
  const char* text = std::getenv("LEAP_TEST_SECONDS");
  return text ? std::atof(text) : 4;
}

/// CPU time [s] of a thread of this process by its name.
double cpuOfThread(const std::string& name) {
  double seconds = 0;
  DIR* folder = opendir("/proc/self/task");
  while (const dirent* entry = readdir(folder)) {
    const std::string path = std::string("/proc/self/task/") + entry->d_name;
    std::string comm;
    std::ifstream(path + "/comm") >> comm;
    if (comm != name) continue;
    double nanoseconds = 0;
    std::ifstream(path + "/schedstat") >> nanoseconds;
    seconds += nanoseconds * 1e-9;
  }
  closedir(folder);
  return seconds;
}

double cpuOfThisThread() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + time.tv_nsec * 1e-9;
}

class LeapRate : public testing::Test {
 protected:
  LeapRate() {
    leap_.setRate(0.979);  // as measured on a real unit
    bus_.port(1).plug(leap_);
  }
  LeapDevice& device() {
    if (!device_) device_ = std::make_unique<LeapDevice>(context_, "");
    return *device_;
  }

  EmulatedLeap leap_;
  EmulatedBus bus_;
  UsbContext context_;
  std::unique_ptr<LeapDevice> device_;
};

/// Whether a frame is, bit by bit, what the device sent.
bool isAsSent(const LeapFrame& frame) {
  EmulatedLeap::Frame sent;
  sent.index = EmulatedLeap::numberInNoise(frame.images.left);
  sent.size = frame.images.left.size();
  static Bytes raster;
  raster.resize(2 * frame.images.left.total());
  EmulatedLeap::noise(sent, raster.data());
  for (std::size_t i = 0; i < raster.size() / 2 - kMetadataSamples; ++i)
    if (raster[2 * i] != frame.images.left.data[i] ||
        raster[2 * i + 1] != frame.images.right.data[i])
      return false;
  return true;
}

class LeapRateOfMode : public LeapRate, public testing::WithParamInterface<LeapMode> {};

TEST_P(LeapRateOfMode, losesNoFrameAndChangesNoBit) {
  const LeapModeInfo& mode = leapModeInfo(GetParam());
  LeapStreamParams params;
  params.mode = GetParam();
  params.queue = 64;  // the comparison below takes longer than the driver
  device().start(params, {});
  while (!device().grab(milliseconds(100))) {
  }
  EmulatedFiles& files = EmulatedFiles::instance();
  files.setMetered(true);
  const double cpu_before = cpuOfThread("leap_usb") - files.meteredSeconds();
  double cpu_of_grab = 0;
  int frames = 0, changed = 0, skipped = 0;
  std::optional<std::uint32_t> last;
  const auto begin = std::chrono::steady_clock::now();
  const auto end = begin + std::chrono::duration<double>(secondsOfTest());
  while (std::chrono::steady_clock::now() < end) {
    const double before = cpuOfThisThread();
    const auto frame = device().grab(milliseconds(100));
    cpu_of_grab += cpuOfThisThread() - before;
    if (!frame) continue;
    ++frames;
    changed += !isAsSent(*frame);
    const std::uint32_t number = EmulatedLeap::numberInNoise(frame->images.left);
    skipped += last && number != *last + 1;
    last = number;
  }
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const double cpu = cpuOfThread("leap_usb") - files.meteredSeconds() - cpu_before + cpu_of_grab;
  files.setMetered(false);
  const LeapCounters counters = device().counters();
  std::printf(
      "%s: %.0f s, %d frames (%.1f/s), %d skipped, %d changed, %llu torn, %llu dropped, %llu "
      "payloads "
      "lost in the device; driver %.1f us of CPU a frame, %.2f %% of a core at the nominal rate\n",
      mode.name, seconds, frames, frames / seconds, skipped, changed,
      static_cast<unsigned long long>(counters.frames.torn),
      static_cast<unsigned long long>(counters.dropped),
      static_cast<unsigned long long>(leap_.payloadsLost()), 1e6 * cpu / frames,
      100 * cpu / frames * mode.rate());
  EXPECT_EQ(0, changed);
  // Only a computer so busy that the device's own buffer ran over may lose frames.
  const std::uint64_t lost = leap_.payloadsLost();
  EXPECT_LE(counters.frames.torn, lost);
  EXPECT_LE(static_cast<std::uint64_t>(skipped), lost);
  EXPECT_EQ(0u, counters.dropped);
  EXPECT_GT(frames, 0.8 * mode.rate() * seconds);
}

INSTANTIATE_TEST_SUITE_P(Each, LeapRateOfMode,
                         testing::Values(LeapMode::k640x240, LeapMode::k640x120),
                         [](const auto& info) {
                           return std::string("of") + leapModeInfo(info.param).name;
                         });

TEST_F(LeapRate, stampsAreSteadyThoughUsbIsLate) {
  bus_.port(1).usbfs().setDelay(
      [random = std::mt19937(5),
       delay = std::exponential_distribution<double>(1 / 0.0005)]() mutable {
        const double late = delay(random) + (random() % 400 == 0 ? 0.006 : 0);
        return std::chrono::duration_cast<EmulatedLeap::Clock::duration>(
            std::chrono::duration<double>(late));
      });
  LeapControls controls;
  controls.exposure_us = 400;
  LeapStreamParams params;
  params.queue = 64;
  device().start(params, controls);
  const double settle = std::min(3.0, secondsOfTest() / 2);
  const auto begin = std::chrono::steady_clock::now();
  std::vector<double> errors;
  std::vector<double> arrivals;
  while (true) {
    const auto frame = device().grab(milliseconds(100));
    const auto now = std::chrono::steady_clock::now();
    const double since = std::chrono::duration<double>(now - begin).count();
    if (since > settle + secondsOfTest()) break;
    if (!frame || since < settle) continue;
    const auto read_out = leap_.readOutOf(EmulatedLeap::numberInNoise(frame->images.left));
    const auto true_middle = read_out - std::chrono::microseconds(200);
    const auto stamp_on_steady = now + (frame->images.stamp - std::chrono::system_clock::now());
    errors.push_back(
        std::chrono::duration<double, std::milli>(stamp_on_steady - true_middle).count());
    arrivals.push_back(std::chrono::duration<double, std::milli>(now - true_middle).count());
  }
  ASSERT_GT(errors.size(), 100u);
  const auto spread = [](std::vector<double> values) {
    double mean = 0, square = 0;
    for (const double value : values) mean += value / static_cast<double>(values.size());
    for (const double value : values)
      square += (value - mean) * (value - mean) / static_cast<double>(values.size());
    return std::make_pair(mean, std::sqrt(square));
  };
  const auto [mean, jitter] = spread(errors);
  const auto [late, late_jitter] = spread(arrivals);
  std::printf(
      "stamps: %.2f ms off on average, jitter %.3f ms; arrivals: %.2f ms late, jitter %.3f ms\n",
      mean, jitter, late, late_jitter);
  EXPECT_NEAR(0, mean, 1.5);
  EXPECT_LT(jitter, 0.5 * late_jitter);
}

}  // namespace
}  // namespace leap_object_tracker
