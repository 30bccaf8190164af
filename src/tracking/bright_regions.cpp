#include "leap_object_tracker/tracking/bright_regions.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace leap_object_tracker {
namespace {

constexpr std::array<int, 19> kThresholds{5,  6,  8,  10, 12, 15,  18,  22,  27, 33,
                                          40, 50, 62, 77, 95, 120, 150, 185, 225};
constexpr std::array<int, 2> kGaps{9, 21};  // [px of half the size] that are closed
constexpr double kSmallest = 40;            // [px^2]
constexpr double kSameArea = 0.85;
constexpr double kDimFaces = 1.15;  // growth of a region that is more than blur

/// The region inside of a closed line of pixels of half the size.
BrightRegion regionOf(const std::vector<cv::Point>& line, const cv::Size& size, int threshold,
                      int closing) {
  BrightRegion region;
  // The line runs through the middle of the outermost pixels.
  region.area = 4 * (cv::contourArea(line) + cv::arcLength(line, true) / 2 + 1);
  const cv::Rect box = cv::boundingRect(line);
  region.low_u = 2.0 * box.x - 0.5;
  region.low_v = 2.0 * box.y - 0.5;
  region.high_u = region.low_u + 2.0 * box.width;
  region.high_v = region.low_v + 2.0 * box.height;
  region.extents.setConstant(-1e9F);
  region.known.setOnes();
  for (const cv::Point& point : line) {
    const auto reach = (BrightRegion::cosines() * (2 * static_cast<float>(point.x) + 0.5F) +
                        BrightRegion::sines() * (2 * static_cast<float>(point.y) + 0.5F) + 1.0F)
                           .eval();
    const bool cut =
        point.x <= 1 || point.y <= 1 || point.x >= size.width - 2 || point.y >= size.height - 2;
    for (int i = 0; i < BrightRegion::kDirections; ++i) {
      if (reach[i] <= region.extents[i]) continue;
      region.extents[i] = reach[i];
      region.known[i] = cut ? 0.0F : 1.0F;
    }
  }
  region.faintest = region.brightest = threshold;
  region.closing = closing;
  return region;
}

bool isInside(const BrightRegion& inner, const BrightRegion& outer) {
  return inner.low_u >= outer.low_u && inner.low_v >= outer.low_v && inner.high_u <= outer.high_u &&
         inner.high_v <= outer.high_v;
}

void addRegions(const cv::Mat& half, int closing, std::vector<BrightRegion>& regions) {
  // Regions that hardly shrink from one threshold to the next are links of one chain.
  std::vector<std::vector<BrightRegion>> open, still_open;
  const auto close = [&](std::vector<BrightRegion>& chain) {
    // Half of the step from the dark to the dimmest part lies where the edge is, blurred or not.
    const double half_way = 0.5 * chain.back().brightest;
    BrightRegion middle = *std::min_element(
        chain.begin(), chain.end(), [&](const BrightRegion& a, const BrightRegion& b) {
          return std::abs(a.faintest - half_way) < std::abs(b.faintest - half_way);
        });
    middle.faintest = chain.front().faintest;
    middle.brightest = chain.back().brightest;
    regions.push_back(middle);
    // Faces that look away from the light show in the lowest one only.
    BrightRegion whole = chain.front();
    if (whole.area < kDimFaces * middle.area) return;
    whole.brightest = middle.brightest;
    regions.push_back(whole);
  };
  cv::Mat mask;
  std::vector<std::vector<cv::Point>> lines;
  double brightest = 0;
  cv::minMaxLoc(half, nullptr, &brightest);
  for (const int threshold : kThresholds) {
    if (threshold >= brightest) break;
    cv::threshold(half, mask, threshold, 255, cv::THRESH_BINARY);
    cv::findContours(mask, lines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_SIMPLE);
    still_open.clear();
    for (const auto& line : lines) {
      if (line.size() < 4) continue;
      const BrightRegion region = regionOf(line, half.size(), threshold, closing);
      if (region.area < kSmallest) continue;
      const auto chain = std::find_if(open.begin(), open.end(), [&](const auto& links) {
        return !links.empty() && region.area > kSameArea * links.back().area &&
               isInside(region, links.back());
      });
      if (chain == open.end()) {
        still_open.push_back({region});
      } else {
        chain->push_back(region);
        still_open.push_back(std::move(*chain));
        chain->clear();
      }
    }
    for (auto& chain : open)
      if (!chain.empty()) close(chain);
    std::swap(open, still_open);
  }
  for (auto& chain : open) close(chain);
}

}  // namespace

const BrightRegion::Extents& BrightRegion::cosines() {
  static const Extents values =
      (Extents::LinSpaced(0, kDirections - 1) * static_cast<float>(2 * M_PI / kDirections)).cos();
  return values;
}

const BrightRegion::Extents& BrightRegion::sines() {
  static const Extents values =
      (Extents::LinSpaced(0, kDirections - 1) * static_cast<float>(2 * M_PI / kDirections)).sin();
  return values;
}

std::optional<double> BrightRegion::apart(const BrightRegion& other, int direction) const {
  const int opposite = (direction + kDirections / 2) % kDirections;
  double sum = 0, sides = 0;
  for (const int i : {direction, opposite}) {
    if (known[i] < 0.5F || other.known[i] < 0.5F) continue;
    sum += static_cast<double>(extents[i] - other.extents[i]) * (i == direction ? 1 : -1);
    sides += 1;
  }
  if (sides == 0) return std::nullopt;
  return sum / sides;
}

std::vector<BrightRegion> findBrightRegions(const cv::Mat& image) {
  std::vector<BrightRegion> regions;
  if (image.empty()) return regions;
  cv::Mat half, closed;
  cv::resize(image, half, cv::Size(), 0.5, 0.5, cv::INTER_AREA);
  cv::GaussianBlur(half, half, cv::Size(3, 3), 0.7);
  addRegions(half, 0, regions);
  for (std::size_t i = 0; i < kGaps.size(); ++i) {
    cv::morphologyEx(half, closed, cv::MORPH_CLOSE,
                     cv::getStructuringElement(cv::MORPH_RECT, cv::Size(kGaps[i], kGaps[i])));
    addRegions(closed, static_cast<int>(i) + 1, regions);
  }
  return regions;
}

std::vector<BrightRegion> findDarkRegions(const cv::Mat& image) {
  return findBrightRegions(image.empty() ? image : cv::Mat(255 - image));
}

}  // namespace leap_object_tracker
