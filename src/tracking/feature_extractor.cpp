#include "leap_object_tracker/tracking/feature_extractor.hpp"

#include <dlib/array2d.h>
#include <dlib/image_keypoint/surf.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <tuple>

namespace leap_object_tracker {
namespace {

constexpr int kMargin = 20;          // [scaled px] reach of a descriptor, whatever its roll
constexpr int kCornerSpacing = 3;    // [scaled px] between corners that are kept
constexpr int kLowestThreshold = 4;  // [grey levels] of FAST, above the sensor's noise
constexpr double kLeastZoom = 0.5;
constexpr double kMostZoom = 3.0;
constexpr int kPatch = 5;        // [scaled px] half size of the patch that confirms a match
constexpr int kPatchSearch = 3;  // [scaled px] to both sides
constexpr double kLeastCorrelation = 0.70;
constexpr double kSurfThreshold = 30;  // of dlib's determinant of the Hessian, its own default

/// The SURF descriptor of dlib::compute_surf_descriptor at its smallest scale, about places that
/// are whole pixels: responses of Haar wavelets two pixels wide, straight from the pixels, on a
/// grid turned by the roll, summed up in 4 x 4 cells that overlap.
class SurfSampling {
 public:
  /// @param roll [rad]
  /// @param memory is used as long as this lives
  SurfSampling(const cv::Mat& image, double roll, std::vector<WaveletResponse>& memory)
      : row_(image.cols),
        responses_(memory),
        cosine_(static_cast<float>(std::cos(roll))),
        sine_(static_cast<float>(std::sin(roll))) {
    respond(image);
    const double c = std::cos(roll), s = std::sin(roll);
    for (std::size_t i = 0; i < offsets_.size(); ++i) {
      constexpr double kHalf = kSide / 2;
      const double from_u = static_cast<double>(i % kSide) - kHalf;
      const double from_v = static_cast<double>(i / kSide) - kHalf;
      const double u = std::floor(c * from_u - s * from_v + 0.5);
      const double v = std::floor(s * from_u + c * from_v + 0.5);
      offsets_[i] = static_cast<std::ptrdiff_t>(v) * row_ + static_cast<std::ptrdiff_t>(u);
    }
  }

  FeatureDescriptor operator()(const cv::Point& place) const {
    const WaveletResponse* centre = responses_.data() + place.y * row_ + place.x;
    std::array<Sums, kStride * kStride> samples{};  // with a border of zeros
    for (std::size_t y = 0; y < kSide; ++y) {
      std::array<WaveletResponse, kSide> here;
      for (std::size_t x = 0; x < kSide; ++x) here[x] = centre[offsets_[y * kSide + x]];
      Sums* to = samples.data() + (y + 1) * kStride + 1;
      for (std::size_t x = 0; x < kSide; ++x) {
        const auto along_u = static_cast<float>(here[x].u), along_v = static_cast<float>(here[x].v);
        const float along_x = cosine_ * along_u + sine_ * along_v;
        const float along_y = cosine_ * along_v - sine_ * along_u;
        to[x] = {along_x, along_y, std::abs(along_x), std::abs(along_y)};
      }
    }
    FeatureDescriptor descriptor;
    auto out = descriptor.begin();
    for (std::size_t y = 0; y < kSide; y += kCell)
      for (std::size_t x = 0; x < kSide; x += kCell) {
        const Sums sums = sumOf(samples.data() + y * kStride + x);
        out = std::copy(sums.begin(), sums.end(), out);
      }
    float square = 0;
    for (const float value : descriptor) square += value * value;
    const float factor = 1 / (std::sqrt(square) + 1e-7F);
    for (float& value : descriptor) value *= factor;
    return descriptor;
  }

 private:
  void respond(const cv::Mat& image) {
    responses_.resize(image.total());
    for (int y = 1; y < image.rows; ++y) {
      const auto *above = image.ptr<unsigned char>(y - 1), *here = image.ptr<unsigned char>(y);
      WaveletResponse* to = responses_.data() + y * row_;
      for (int x = 1; x < image.cols; ++x) {
        const int falling = here[x] - above[x - 1], rising = above[x] - here[x - 1];
        to[x] = {static_cast<std::int16_t>(falling + rising),
                 static_cast<std::int16_t>(falling - rising)};
      }
    }
  }

  static constexpr std::size_t kSide = 20, kCell = 5, kReach = kCell + 2;  // samples
  static constexpr std::size_t kStride = kSide + 2;
  using Sums = std::array<float, 4>;  ///< of x, y, |x|, |y|

  /// Over a cell and one sample around it, less the farther from its middle.
  static Sums sumOf(const Sums* corner) {
    static constexpr std::array<float, kReach> kWeights{1 / 4.0F, 1 / 5.0F, 1 / 6.0F, 1 / 7.0F,
                                                        1 / 8.0F, 1 / 9.0F, 1 / 10.0F};
    constexpr std::size_t kMiddle = kReach / 2;
    const auto off = [](std::size_t i) { return i < kMiddle ? kMiddle - i : i - kMiddle; };
    Sums sums{};
#pragma GCC unroll 7
    for (std::size_t y = 0; y < kReach; ++y)
#pragma GCC unroll 7
      for (std::size_t x = 0; x < kReach; ++x) {
        const float weight = kWeights[off(y) + off(x)];
        const Sums& sample = corner[y * kStride + x];
        for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += weight * sample[k];
      }
    return sums;
  }

  std::ptrdiff_t row_;
  std::vector<WaveletResponse>&
      responses_;  ///< of each pixel but those of the first row and column
  float cosine_, sine_;
  std::array<std::ptrdiff_t, kSide * kSide> offsets_;
};

std::vector<dlib::interest_point> surfPoints(const cv::Mat& image) {
  dlib::array2d<unsigned char> copy(image.rows, image.cols);
  for (int row = 0; row < image.rows; ++row)
    for (int column = 0; column < image.cols; ++column)
      copy[row][column] = image.at<unsigned char>(row, column);
  dlib::integral_image_generic<int> integral;
  integral.load(copy);
  dlib::hessian_pyramid pyramid;
  pyramid.build_pyramid(integral, 4, 6, 2);
  std::vector<dlib::interest_point> points;
  dlib::get_interest_points(pyramid, kSurfThreshold, points);
  return points;
}

/// Between the darkest and the brightest twentieth [grey levels], of every fourth pixel.
int contrastOf(const cv::Mat& image) {
  std::array<int, 256> counts{};
  int all = 0;
  for (int row = 0; row < image.rows; row += 2) {
    const unsigned char* values = image.ptr<unsigned char>(row);
    for (int column = 0; column < image.cols; column += 2) ++counts[values[column]];
    all += (image.cols + 1) / 2;
  }
  const int part = all / 20;
  int low = 0, high = 255;
  for (int sum = counts[0]; sum < part && low < 255; sum += counts[static_cast<std::size_t>(low)])
    ++low;
  for (int sum = counts[255]; sum < part && high > 0; sum += counts[static_cast<std::size_t>(high)])
    --high;
  return std::max(0, high - low);
}

/// Zero-mean normalised cross-correlation of two square patches.
double correlation(const cv::Mat& a, const cv::Point& at_a, const cv::Mat& b,
                   const cv::Point& at_b) {
  int sum_a = 0, sum_b = 0, sum_aa = 0, sum_bb = 0, sum_ab = 0;
  for (int y = -kPatch; y <= kPatch; ++y) {
    const unsigned char* row_a = a.ptr<unsigned char>(at_a.y + y) + at_a.x;
    const unsigned char* row_b = b.ptr<unsigned char>(at_b.y + y) + at_b.x;
    for (int x = -kPatch; x <= kPatch; ++x) {
      const int value_a = row_a[x], value_b = row_b[x];
      sum_a += value_a;
      sum_b += value_b;
      sum_aa += value_a * value_a;
      sum_bb += value_b * value_b;
      sum_ab += value_a * value_b;
    }
  }
  constexpr double kCount = (2 * kPatch + 1) * (2 * kPatch + 1);
  const double spread_a = sum_aa - sum_a * (sum_a / kCount);
  const double spread_b = sum_bb - sum_b * (sum_b / kCount);
  if (spread_a < kCount || spread_b < kCount) return 0;
  return (sum_ab - sum_a * (sum_b / kCount)) / std::sqrt(spread_a * spread_b);
}

/// Place on a row or column of pixels: between index and the next one, by weight / 256.
struct Tap {
  int index, next, weight;
};

/// Of the grid place / zoom; beyond the border the outermost pixel.
Tap tapAt(int place, double zoom, int pixels) {
  const double at = std::clamp(place / zoom, 0.0, pixels - 1.0);
  const int index = static_cast<int>(at);
  return {index, std::min(index + 1, pixels - 1), static_cast<int>(256 * (at - index))};
}

/// Bilinear. @param first the place of scaled(0, 0) on the grid
void resample(const cv::Mat& image, const cv::Point& first, double zoom, cv::Mat& scaled) {
  thread_local std::vector<Tap> columns;
  thread_local std::array<std::vector<std::int16_t>, 2> rows;  // [1/64 grey levels]
  std::array<int, 2> known{-1, -1};
  const auto width = static_cast<std::size_t>(scaled.cols);
  columns.resize(width);
  for (std::size_t x = 0; x < width; ++x)
    columns[x] = tapAt(first.x + static_cast<int>(x), zoom, image.cols);
  const auto rowAt = [&](int index) {
    const auto slot = static_cast<std::size_t>(index % 2);
    if (known[slot] != index) {
      known[slot] = index;
      rows[slot].resize(width);
      const unsigned char* from = image.ptr<unsigned char>(index);
      for (std::size_t x = 0; x < width; ++x) {
        const Tap& tap = columns[x];
        rows[slot][x] = static_cast<std::int16_t>(
            ((from[tap.index] << 8) + tap.weight * (from[tap.next] - from[tap.index])) >> 2);
      }
    }
    return rows[slot].data();
  };
  for (int y = 0; y < scaled.rows; ++y) {
    const Tap tap = tapAt(first.y + y, zoom, image.rows);
    const std::int16_t *upper = rowAt(tap.index), *lower = rowAt(tap.next);
    unsigned char* to = scaled.ptr<unsigned char>(y);
    const int weight = tap.weight << 7;
    for (std::size_t x = 0; x < width; ++x) {
      // In 16 bits, so that the compiler takes as many at a time as it can.
      const auto twice = static_cast<std::int16_t>(2 * (lower[x] - upper[x]));
      const auto value = static_cast<std::int16_t>(upper[x] + (twice * weight >> 16));
      to[x] = static_cast<unsigned char>((value + 32) >> 6);
    }
  }
}

bool patchFits(const cv::Mat& image, const cv::Point& place) {
  return place.x >= kPatch && place.y >= kPatch && place.x < image.cols - kPatch &&
         place.y < image.rows - kPatch;
}

/// Column in `right` of what `left` shows at `place`, to a part of a pixel, on the given row.
std::optional<double> refineColumn(const cv::Mat& left, const cv::Point& place,
                                   const cv::Mat& right, const cv::Point& guess) {
  std::array<double, 2 * kPatchSearch + 1> scores{};
  int best = 0;
  if (!patchFits(left, place)) return std::nullopt;
  for (int shift = -kPatchSearch; shift <= kPatchSearch; ++shift) {
    const cv::Point there(guess.x + shift, guess.y);
    if (!patchFits(right, there)) return std::nullopt;
    const int i = shift + kPatchSearch;
    scores[static_cast<std::size_t>(i)] = correlation(left, place, right, there);
    if (scores[static_cast<std::size_t>(i)] > scores[static_cast<std::size_t>(best)]) best = i;
  }
  if (best == 0 || best == 2 * kPatchSearch) return std::nullopt;
  const auto at = [&](int i) { return scores[static_cast<std::size_t>(i)]; };
  if (at(best) < kLeastCorrelation) return std::nullopt;
  const double bend = at(best - 1) - 2 * at(best) + at(best + 1);
  const double part = bend < 0 ? 0.5 * (at(best - 1) - at(best + 1)) / bend : 0;
  return guess.x + best - kPatchSearch + part;
}

}  // namespace

float squaredDistance(const FeatureDescriptor& a, const FeatureDescriptor& b) {
  std::array<float, 8> sums{};
  for (std::size_t i = 0; i < a.size(); i += sums.size())
    for (std::size_t k = 0; k < sums.size(); ++k)
      sums[k] += (a[i + k] - b[i + k]) * (a[i + k] - b[i + k]);
  float sum = 0;
  for (const float part : sums) sum += part;
  return sum;
}

void triangulate(const RectifiedStereoCamera& camera, const Eigen::Vector2d& left_pixel,
                 double disparity, double corner_sigma, double disparity_sigma,
                 Eigen::Vector3d& point_in_camera, Eigen::Matrix3d& covariance) {
  const double f = camera.focal_length;
  const double z = f * camera.baseline / disparity;
  const double x = (left_pixel.x() - camera.center_u) * z / f;
  const double y = (left_pixel.y() - camera.center_v) * z / f;
  point_in_camera = Eigen::Vector3d(x, y, z);
  Eigen::Matrix3d jacobian;  // of (x, y, z) by (u, v, disparity)
  jacobian << z / f, 0, -x / disparity, 0, z / f, -y / disparity, 0, 0, -z / disparity;
  const Eigen::Vector3d noise(corner_sigma, corner_sigma, disparity_sigma);
  covariance = jacobian * noise.cwiseAbs2().asDiagonal() * jacobian.transpose();
}

FeatureExtractor::FeatureExtractor(const FeatureParams& params, const RectifiedStereoCamera& camera,
                                   CornerDetector detector)
    : params_(params), camera_(camera), detector_(detector) {}

const std::vector<StereoFeature>& FeatureExtractor::extract(const RectifiedStereoFrame& frame,
                                                            const FeatureWindow& window) {
  features_.clear();
  counts_ = {};
  for (auto& eye : eyes_) eye.corners.clear();
  const cv::Rect whole(cv::Point(), camera_.size);
  if (frame.left.empty() || frame.right.empty() || !(window.nearest > 0) ||
      (window.regions[0] & whole).area() == 0 || (window.regions[1] & whole).area() == 0)
    return features_;
  const double depth = 0.5 * (window.nearest + window.farthest);
  const double zoom =
      std::clamp(params_.resolution * depth / camera_.focal_length, kLeastZoom, kMostZoom);
  tbb::parallel_for(std::size_t{0}, std::size_t{2}, [&](std::size_t eye) {
    prepare(eye == 0 ? frame.left : frame.right, window.regions[eye] & whole, zoom, window.roll,
            eyes_[eye]);
  });
  counts_.left_corners = static_cast<int>(eyes_[0].corners.size());
  counts_.right_corners = static_cast<int>(eyes_[1].corners.size());
  match(window, zoom);
  counts_.features = static_cast<int>(features_.size());
  return features_;
}

void FeatureExtractor::prepare(const cv::Mat& image, const cv::Rect& region, double zoom,
                               double roll, EyeImage& eye) const {
  // Both eyes are sampled at the same rows: the grid of the scaled image starts at row and column
  // 0.
  const auto gridFloor = [&](int pixel) { return static_cast<int>(std::floor(pixel * zoom)); };
  const int first_column = gridFloor(region.x) - kMargin, first_row = gridFloor(region.y) - kMargin;
  const cv::Size size(gridFloor(region.x + region.width) - first_column + kMargin,
                      gridFloor(region.y + region.height) - first_row + kMargin);
  eye.origin = cv::Point2d(first_column / zoom, first_row / zoom);
  eye.scaled.create(size, CV_8UC1);
  resample(image, {first_column, first_row}, zoom, eye.scaled);

  if (detector_ == CornerDetector::kFast) {
    findFast(eye);
  } else {
    const cv::Rect inside(kMargin, kMargin, size.width - 2 * kMargin, size.height - 2 * kMargin);
    for (const auto& point : surfPoints(eye.scaled)) {
      const cv::Point place(static_cast<int>(std::lround(point.center.x())),
                            static_cast<int>(std::lround(point.center.y())));
      if (inside.contains(place))
        eye.corners.push_back({place, static_cast<float>(point.score), {}});
    }
  }
  const SurfSampling describe(eye.scaled, roll, eye.responses);
  for (Corner& corner : eye.corners) corner.descriptor = describe(corner.place);
}

void FeatureExtractor::findFast(EyeImage& eye) const {
  const cv::Rect inside(kMargin, kMargin, eye.scaled.cols - 2 * kMargin,
                        eye.scaled.rows - 2 * kMargin);
  const int threshold = std::max(
      kLowestThreshold,
      static_cast<int>(std::lround(params_.least_contrast * contrastOf(eye.scaled(inside)))));
  std::vector<cv::KeyPoint>& found = eye.found;
  eye.taken.create(eye.scaled.size(), CV_8UC1);
  eye.taken = 0;
  cv::FAST(eye.scaled, found, threshold, true);
  // The strongest first, from a heap: of many only the first few are wanted.
  const auto weaker = [](const cv::KeyPoint& a, const cv::KeyPoint& b) {
    return std::make_tuple(-a.response, a.pt.y, a.pt.x) >
           std::make_tuple(-b.response, b.pt.y, b.pt.x);
  };
  std::make_heap(found.begin(), found.end(), weaker);
  for (auto last = found.end(); last != found.begin(); --last) {
    if (eye.corners.size() >= static_cast<std::size_t>(params_.corners)) break;
    std::pop_heap(found.begin(), last, weaker);
    const cv::KeyPoint& point = *(last - 1);
    const cv::Point place(cvRound(point.pt.x), cvRound(point.pt.y));
    if (!inside.contains(place)) continue;
    if (eye.taken.at<unsigned char>(place) != 0) continue;
    for (int y = -kCornerSpacing + 1; y < kCornerSpacing; ++y)
      std::memset(eye.taken.ptr(place.y + y, place.x - kCornerSpacing + 1), 1,
                  2 * kCornerSpacing - 1);
    eye.corners.push_back({place, point.response, {}});
  }
}

void FeatureExtractor::match(const FeatureWindow& window, double zoom) {
  const auto& left = eyes_[0];
  const auto& right = eyes_[1];
  const auto pixelOf = [&](const EyeImage& eye, const Corner& corner) {
    return Eigen::Vector2d(eye.origin.x + corner.place.x / zoom,
                           eye.origin.y + corner.place.y / zoom);
  };
  const double fb = camera_.focal_length * camera_.baseline;
  const double least = fb / window.farthest, most = fb / window.nearest;
  auto& [of_left, of_right] = nearest_;
  of_left.assign(left.corners.size(), Best());
  of_right.assign(right.corners.size(), Best());
  const auto offer = [](Best& best, float distance, std::size_t index) {
    if (distance < best.distance) {
      best.second = best.distance;
      best.distance = distance;
      best.index = static_cast<int>(index);
    } else {
      best.second = std::min(best.second, distance);
    }
  };
  for (std::size_t l = 0; l < left.corners.size(); ++l) {
    const Eigen::Vector2d left_pixel = pixelOf(left, left.corners[l]);
    for (std::size_t r = 0; r < right.corners.size(); ++r) {
      const Eigen::Vector2d apart = left_pixel - pixelOf(right, right.corners[r]);
      if (std::abs(apart.y()) > params_.epipolar_distance || apart.x() < least || apart.x() > most)
        continue;
      const float distance =
          squaredDistance(left.corners[l].descriptor, right.corners[r].descriptor);
      offer(of_left[l], distance, r);
      offer(of_right[r], distance, l);
    }
  }
  const auto ratio = static_cast<float>(params_.ratio * params_.ratio);
  const double row_shift = (left.origin.y - right.origin.y) * zoom;
  for (std::size_t l = 0; l < left.corners.size(); ++l) {
    const Best& best = of_left[l];
    if (best.index < 0 || best.distance > ratio * best.second) continue;
    const auto r = static_cast<std::size_t>(best.index);
    if (of_right[r].index != static_cast<int>(l)) continue;
    ++counts_.matches;
    const cv::Point guess(right.corners[r].place.x,
                          left.corners[l].place.y + static_cast<int>(std::lround(row_shift)));
    const auto column = refineColumn(left.scaled, left.corners[l].place, right.scaled, guess);
    if (!column) continue;
    StereoFeature feature;
    feature.left_pixel = pixelOf(left, left.corners[l]);
    feature.disparity = feature.left_pixel.x() - (right.origin.x + *column / zoom);
    if (feature.disparity < least || feature.disparity > most) continue;
    triangulate(camera_, feature.left_pixel, feature.disparity, params_.corner_sigma,
                params_.disparity_sigma, feature.point_in_camera, feature.covariance);
    feature.descriptor = left.corners[l].descriptor;
    features_.push_back(feature);
  }
}

}  // namespace leap_object_tracker
