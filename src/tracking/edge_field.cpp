#include "leap_object_tracker/tracking/edge_field.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace leap_object_tracker {
namespace {

constexpr int kMargin = GainMap::kMargin;
constexpr int kStampRow = 32;      // [bytes]
constexpr double kLeastNoise = 4;  // of a Sobel response: images are rounded to grey levels

// Grey levels to a scale on which shot and read noise look the same everywhere (Anscombe 1948,
// generalised): kStabilizedScale * sqrt(x + kStabilizedOffset).
constexpr double kStabilizedOffset = 6;
const double kStabilizedScale =
    255 / (std::sqrt(255 + kStabilizedOffset) - std::sqrt(kStabilizedOffset));

const cv::Mat& varianceStabilizer() {
  static const cv::Mat table = [] {
    cv::Mat values(1, 256, CV_8UC1);
    for (int i = 0; i < 256; ++i)
      values.at<std::uint8_t>(i) = cv::saturate_cast<std::uint8_t>(
          kStabilizedScale * (std::sqrt(i + kStabilizedOffset) - std::sqrt(kStabilizedOffset)));
    return values;
  }();
  return table;
}

// Patches all over the image, of which a quarter are taken to show noise alone.
constexpr int kPatch = 16;  // [px]
constexpr int kPatchesAcross = 8, kPatchesDown = 6;
constexpr double kPlainShare = 0.25;
constexpr float kNoisier = 3;  // than those a region may be

/// Standard deviation of a gradient image, from its mean magnitude.
float meanDeviation(const ImageMemory<std::int16_t>& gradient) {
  int sum = 0;
  for (int v = 0; v < gradient.rows(); ++v)
    for (int u = 0; u < gradient.columns(); ++u) sum += std::abs(gradient.row(v)[u]);
  const double mean = static_cast<double>(sum) / (gradient.rows() * gradient.columns());
  return static_cast<float>(mean * std::sqrt(M_PI / 2));
}

/// Standard deviation of the gradients of a whole image where it is plain: textured surroundings
/// are no noise.
float plainDeviation(const cv::Mat& image, EdgeDetector& detector) {
  if (image.cols < 2 * kPatch || image.rows < 2 * kPatch) return std::numeric_limits<float>::max();
  std::array<float, kPatchesAcross * kPatchesDown> deviations;
  std::size_t count = 0;
  for (int y = 0; y < kPatchesDown; ++y)
    for (int x = 0; x < kPatchesAcross; ++x) {
      const cv::Rect patch((image.cols - kPatch) * x / (kPatchesAcross - 1),
                           (image.rows - kPatch) * y / (kPatchesDown - 1), kPatch, kPatch);
      detector.differentiate(image(patch), varianceStabilizer().ptr<std::uint8_t>());
      deviations[count++] = std::max(meanDeviation(detector.du()), meanDeviation(detector.dv()));
    }
  const auto plain =
      deviations.begin() + static_cast<std::ptrdiff_t>(kPlainShare * static_cast<double>(count));
  std::nth_element(deviations.begin(), plain, deviations.end());
  return *plain;
}

/// Standard deviation of a gradient image, from its median magnitude: edges are few.
float robustDeviation(const ImageMemory<std::int16_t>& gradient) {
  constexpr int kBins = 256;
  std::array<int, kBins> histogram{};
  int count = 0;
  for (int v = 0; v < gradient.rows(); v += 2) {
    const std::int16_t* row = gradient.row(v);
    for (int u = 0; u < gradient.columns(); u += 2) {
      ++histogram[static_cast<std::size_t>(std::min(std::abs(row[u]), kBins - 1))];
      ++count;
    }
  }
  int below = 0, median = 0;
  while (median < kBins - 1 && (below += histogram[static_cast<std::size_t>(median)]) * 2 < count)
    ++median;
  return static_cast<float>((median + 0.5) / 0.6745);
}

}  // namespace

void EdgeField::build(const cv::Mat& image, const cv::Rect& region) {
  edgels_.clear();
  image_size_ = image.size();
  region_ = region & cv::Rect(cv::Point(), image.size());
  if (image.empty() || region_.width < 8 || region_.height < 8) {
    smooth_.release();
    region_ = cv::Rect();
    return;
  }
  image_ = image(region_);
  detector_.smooth(image_, 16, smooth_memory_);
  smooth_ = cv::Mat(image_.size(), CV_16SC1, smooth_memory_.row(0));
  detector_.differentiate(image_, varianceStabilizer().ptr<std::uint8_t>());

  constexpr float kWeakest = 20;  // a step of 5 grey levels of 255 after smoothing
  static_assert(kWeakest >= 5 * kLeastNoise, "less than the least noise changes nothing");
  float noise = std::max(robustDeviation(detector_.du()), robustDeviation(detector_.dv()));
  if (noise > kLeastNoise)
    noise = std::min(noise, kNoisier * plainDeviation(image, patch_detector_));
  // A Sobel response is 8 slopes; back from the stabilised scale by its derivative.
  const auto slope_noise =
      static_cast<float>(std::max(kLeastNoise, static_cast<double>(noise)) / 8 / kStabilizedScale);
  for (std::size_t grey = 0; grey < slope_noise_.size(); ++grey)
    slope_noise_[grey] =
        2 * slope_noise *
        std::sqrt(static_cast<float>(grey) + static_cast<float>(kStabilizedOffset));
  const float high = std::max(kWeakest, 5.0F * noise);
  detector_.findEdges(0.4F * high, high);

  for (int v = 0; v < image_.rows; ++v) {
    const std::int16_t *du = detector_.du().row(v), *dv = detector_.dv().row(v);
    for (int u = 0; u < image_.cols; ++u) {
      if (!detector_.isEdge(u, v)) continue;
      const float degrees = cv::fastAtan2(static_cast<float>(du[u]), static_cast<float>(-dv[u]));
      edgels_.push_back({static_cast<std::int16_t>(u + region_.x),
                         static_cast<std::int16_t>(v + region_.y),
                         static_cast<std::uint8_t>(static_cast<int>(degrees * (256 / 180.0F)))});
    }
  }
}

void EdgeField::transform(const EdgeKernel& kernel, int coarseness, GainMap& map) const {
  map.cells_per_pixel = 1.0F / static_cast<float>(coarseness);
  map.width = region_.width / coarseness + 2;
  map.height = region_.height / coarseness + 2;
  map.row_stride = (map.width + 2 * kMargin + 15) / 16 * 16;
  map.plane_stride = map.row_stride * (map.height + 2 * kMargin);
  // Cell 1 is the first inside; a cell's centre lies in the middle of its pixels.
  const float middle = 0.5F * static_cast<float>(coarseness - 1);
  map.origin_u = static_cast<float>(region_.x) + middle - static_cast<float>(coarseness);
  map.origin_v = static_cast<float>(region_.y) + middle - static_cast<float>(coarseness);
  map.nats_per_step = kernel.log_ratio / 127.0F;
  map.gains.assign(static_cast<std::size_t>(GainMap::kDirections * map.plane_stride + 64), 0);

  const int reach =
      std::min(15, static_cast<int>(std::floor(kernel.sigma * std::sqrt(2 * kernel.log_ratio))));
  std::array<std::array<std::uint8_t, kStampRow>, kStampRow> stamp{};
  for (int y = -reach; y <= reach; ++y)
    for (int x = -reach; x <= reach; ++x) {
      const float gain = 1 - static_cast<float>(x * x + y * y) /
                                 (2 * kernel.sigma * kernel.sigma * kernel.log_ratio);
      stamp[static_cast<std::size_t>(y + reach)][static_cast<std::size_t>(x + reach)] =
          static_cast<std::uint8_t>(std::lround(127 * std::max(0.0F, gain)));
    }

  std::uint8_t* first = map.first();
  for (const Edgel& edgel : edgels_) {
    const int x = (edgel.u - region_.x) / coarseness + 1,
              y = (edgel.v - region_.y) / coarseness + 1;
    if (x >= map.width || y >= map.height) continue;
    const int low = edgel.direction / 32;
    for (const int plane : {low, (low + 1) % GainMap::kDirections}) {
      std::uint8_t* corner =
          first + plane * map.plane_stride + (y - reach) * map.row_stride + (x - reach);
      for (int r = 0; r <= 2 * reach; ++r, corner += map.row_stride) {
        const std::uint8_t* source = stamp[static_cast<std::size_t>(r)].data();
        for (int i = 0; i < 16; ++i) corner[i] = std::max(corner[i], source[i]);
        if (reach > 7)
          for (int i = 16; i < 32; ++i) corner[i] = std::max(corner[i], source[i]);
      }
    }
  }

  for (int plane = 0; plane < GainMap::kDirections; ++plane) {
    std::uint8_t* start = first + plane * map.plane_stride;
    std::uint64_t sum = 0;
    for (int y = 1; y < map.height - 1; ++y) {
      const std::uint8_t* row = start + y * map.row_stride;
      std::uint32_t row_sum = 0;
      for (int x = 1; x < map.width - 1; ++x) row_sum += row[x];
      sum += row_sum;
    }
    const auto cells = static_cast<std::uint64_t>((map.width - 2) * (map.height - 2));
    const int mean = std::min<int>(GainMap::kZero, static_cast<int>((sum + cells / 2) / cells));
    const auto shift = static_cast<std::uint8_t>(GainMap::kZero - mean);
    for (int y = 0; y < map.height; ++y) {
      std::uint8_t* row = start + y * map.row_stride;
      for (int x = 0; x < map.width; ++x) row[x] = static_cast<std::uint8_t>(row[x] + shift);
    }
    // Outside the image nothing is known; outside the region no edge was looked for.
    const auto outside = [&](bool at_image_border) {
      return at_image_border ? static_cast<std::uint8_t>(GainMap::kZero) : shift;
    };
    std::uint8_t* last = start + (map.height - 1) * map.row_stride;
    std::fill(start, start + map.width, outside(region_.y == 0));
    std::fill(last, last + map.width, outside(region_.br().y >= image_size_.height));
    for (int y = 0; y < map.height; ++y) {
      start[y * map.row_stride] = outside(region_.x == 0);
      start[y * map.row_stride + map.width - 1] = outside(region_.br().x >= image_size_.width);
    }
  }
}

}  // namespace leap_object_tracker
