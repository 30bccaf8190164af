#include "leap_object_tracker/tracking/textured_surface.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "depth_view.hpp"
#include "leap_optics.hpp"
#include "sampler.hpp"

namespace leap_object_tracker {

/// A place that is seen, against what is expected there.
struct SurfaceSample {
  std::size_t index = 0;   ///< of the place
  Eigen::Vector3f arm;     ///< [m] from the object's origin, in the camera's axes
  Eigen::Vector2f offset;  ///< [100 px] from the middle of the samples
  float seen = 0, expected = 0;
  float light = 1;         ///< of which `expected` holds a share
  Eigen::Vector3f slope;   ///< of the residual, by the place in the camera's axes [grey levels/m]
  float moved = 0;         ///< [grey levels^2/px^2] square of the slope in the image
  float own_variance = 1;  ///< [grey levels^2] without that of what is expected
  float variance = 1;      ///< [grey levels^2]
  float gain = 1, residual = 0;
};

namespace {

constexpr float kNearest = 0.01F;  // [m]
// [px] beside rims and edges of the body that are left out, and that are left out to tell whether
// it is textured.
constexpr int kBesideEdges = 3, kFarFromEdges = 4;
constexpr float kSmoothTurn = 0.9F;    // cosine between normals of one smooth surface
constexpr float kFlatTurn = 0.9999F;   // the same of a flat one
constexpr float kStepOfDepth = 0.06F;  // share of the nearness by which a surface bends
constexpr float kHiddenStep = 0.02F;   // of the depth by which a surface is hidden
constexpr float kTextureNoise = 3;     // [noise] of a slope that is texture
// Share of the brightness by which it changes in a pixel: shading changes less.
constexpr float kSlopeOnCurved = 0.15F, kSlopeOnFlat = 0.08F;
constexpr float kUnlikeEyes = 0.2F;  // share of the brightness by which eyes may differ
// Share of the smooth surface that is textured, of an object that is said to be, and of another.
constexpr float kLeastShare = 0.03F, kClearShare = 0.06F;
constexpr float kForgetting = 0.9F;  // of that share, a look
constexpr int kCountEvery = 3;       // [px] both ways, for it
constexpr float kSmoothPixels = 20;  // that tell it
constexpr int kIdlePeriod = 12;      // [frames] between looks at an object without texture
constexpr std::size_t kFewest = 30;  // places that say something
constexpr std::size_t kEnough = 60;  // learned ones that carry a pose
constexpr std::size_t kMost = 300;   // new ones a look
constexpr std::size_t kMostInSight = 500, kMostLearned = 4000;
constexpr float kCellPixels = 1.5F;    // between learned places, as first seen
constexpr float kLeastFacing = 0.3F;   // cosine of the angle at which a place is seen
constexpr int kFirstLooks = 6;         // of both eyes together, before a place counts
constexpr int kPatience = 20;          // looks at something else, before a place is learned anew
constexpr float kFirstSpread = 0.05F;  // of the brightness
constexpr float kLeastRate = 0.03F, kSpreadRate = 0.05F;  // of learning, a look
constexpr float kSaturated = 245;                         // grey level
constexpr float kNoiseOfSlopes = 6;  // variance of a difference of two eyes over that of a slope
constexpr float kRounding = 0.25F;   // [grey levels^2]
constexpr float kFreedom = 9;        // of Student's t-distribution
constexpr double kIndependent = 5;   // places that one independent residual needs
constexpr int kGainFits = 3;
constexpr float kGainSlopes = 0.14F;  // a 100 px: deviation of the gain's slope
constexpr float kLeastGain = 0.15F;   // of what is known, in a place that may look like it
constexpr float kOutlier = 3;         // deviations of a place that looks otherwise
/// What errs of residuals besides noise.
struct Errors {
  float misplaced;  ///< [px] of a place
  float gain;       ///< of the brightness
  /// [px] of calibration, gloss and shape, the same over a part of the surface.
  double common;
};
constexpr Errors kBetweenEyes{0.1F, 0.03F, 0.15}, kAgainstKnown{0.1F, 0.03F, 0.07};
constexpr double kParts = 6;  // of the surface

/// Smoothed grey values of one eye at sub-pixel places of the whole image.
class SmoothImage {
 public:
  explicit SmoothImage(const EdgeField& field) : grey_(field, field.smooth(), 1 / 16.0F) {}

  /// With a pixel around it.
  bool contains(float u, float v) const {
    return grey_.contains(u - 1, v - 1) && grey_.contains(u + 1, v + 1);
  }
  float operator()(float u, float v) const { return grey_(u, v); }
  Eigen::Vector2f slope(float u, float v) const {
    return 0.5F *
           Eigen::Vector2f(grey_(u + 1, v) - grey_(u - 1, v), grey_(u, v + 1) - grey_(u, v - 1));
  }

 private:
  Sampler<std::int16_t> grey_;
};

/// Variance [grey levels^2] that `images` images give to a residual.
float varianceOf(const EdgeField& field, float grey, const Eigen::Vector2f& slope,
                 const Errors& errors, int images) {
  const float noise = field.slopeNoise(grey);
  return 0.5F * static_cast<float>(images) * (kNoiseOfSlopes * noise * noise + kRounding) +
         errors.gain * errors.gain * grey * grey +
         errors.misplaced * errors.misplaced * slope.squaredNorm();
}

void centre(std::vector<SurfaceSample>& samples) {
  if (samples.empty()) return;
  Eigen::Vector2f middle = Eigen::Vector2f::Zero();
  for (const SurfaceSample& s : samples) middle += s.offset;
  middle /= static_cast<float>(samples.size());
  for (SurfaceSample& s : samples) s.offset = 0.01F * (s.offset - middle);
}

Eigen::Vector3f gainColumn(const SurfaceSample& s) { return {1, s.offset.x(), s.offset.y()}; }

/// The plane of gains that best brings what is expected to what is seen; sets the residuals.
Eigen::Vector3f fitGain(std::vector<SurfaceSample>& samples) {
  Eigen::Vector3f gain = Eigen::Vector3f::UnitX();
  for (int fit = 0; fit <= kGainFits; ++fit) {
    Eigen::Matrix3f normal = Eigen::Matrix3f::Zero();
    normal.diagonal() << 1e-3F, Eigen::Vector2f::Constant(1 / (kGainSlopes * kGainSlopes));
    Eigen::Vector3f sums = Eigen::Vector3f::Zero();
    for (SurfaceSample& s : samples) {
      const Eigen::Vector3f column = gainColumn(s);
      s.gain = gain.dot(column);
      s.residual = s.seen - s.gain * s.expected;
      if (fit == kGainFits) continue;
      const float weight = 1 / (s.variance + (fit > 0 ? s.residual * s.residual / kFreedom : 0.0F));
      normal += weight * s.expected * s.expected * column * column.transpose();
      sums += weight * s.expected * s.seen * column;
    }
    if (fit < kGainFits) gain = normal.ldlt().solve(sums);
  }
  return gain;
}

/// Slope of a grey value by the place that it shows, seen from an eye at the origin.
Eigen::Vector3f slopeByPlace(const Eigen::Vector2f& image_slope, const Eigen::Vector3f& at,
                             float focal) {
  const Eigen::Vector2f scaled = image_slope * (focal / at.z());
  return {scaled.x(), scaled.y(), -scaled.dot(at.head<2>()) / at.z()};
}

/// Adds what samples say, of which the gain is fitted. @return their information on a shift
/// across the image [1/px^2]
double add(const std::vector<SurfaceSample>& samples, SurfaceEvidence& evidence) {
  constexpr auto kNu = static_cast<double>(kFreedom);
  double shift = 0;
  Twist jacobian;
  for (const SurfaceSample& s : samples) {
    const double share = static_cast<double>(s.residual * s.residual / s.variance) / kNu;
    const double weight = 1 / (kIndependent * static_cast<double>(s.variance) * (1 + share));
    evidence.log_likelihood -= 0.5 * kNu * std::log1p(share) / kIndependent;
    jacobian.head<3>() = s.slope.cast<double>();
    jacobian.tail<3>() = s.arm.cross(s.slope).cast<double>();
    evidence.information.noalias() += weight * jacobian * jacobian.transpose();
    evidence.gradient -= weight * static_cast<double>(s.residual) * jacobian;
    shift += weight * static_cast<double>(s.moved);
  }
  return shift;
}

/// What errs in common does not average out.
void limit(double shift, const Errors& errors, SurfaceEvidence& evidence) {
  const double most = kParts / (errors.common * errors.common);
  if (shift <= most) return;
  evidence.information *= most / shift;
  evidence.gradient *= most / shift;
  evidence.log_likelihood *= most / shift;
}

/// Brightness of a matt surface under all lamps.
float shadingAt(const Eigen::Vector3f& at, const Eigen::Vector3f& normal, double baseline) {
  float shade = 0;
  for (int lamp = 0; lamp < kLamps; ++lamp)
    shade += lampLight(lampPlace(lamp, baseline), at, normal);
  return shade;
}

/// Whether what lies around a pixel is one smooth surface.
bool smoothAround(const DepthView& seen, const std::vector<Eigen::Vector3f>& normals, int u, int v,
                  float least_cosine = kSmoothTurn, int apart = kBesideEdges) {
  if (u < apart || v < apart || u + apart >= seen.box.width || v + apart >= seen.box.height)
    return false;
  const float here = seen.nearness.at<float>(v, u);
  if (here <= 0) return false;
  const auto normal = [&](int x, int y) -> const Eigen::Vector3f& {
    return normals[static_cast<std::size_t>(seen.triangle.at<int>(y, x))];
  };
  const Eigen::Vector3f& own = normal(u, v);
  const int aslant = apart - 1;
  for (const auto& [du, dv] : {std::array{apart, 0}, std::array{0, apart},
                               std::array{aslant, aslant}, std::array{-aslant, aslant}}) {
    const float before = seen.nearness.at<float>(v - dv, u - du);
    const float after = seen.nearness.at<float>(v + dv, u + du);
    if (before <= 0 || after <= 0 || std::abs(before + after - 2 * here) > kStepOfDepth * here ||
        normal(u - du, v - dv).dot(own) < least_cosine ||
        normal(u + du, v + dv).dot(own) < least_cosine)
      return false;
  }
  return true;
}

}  // namespace

struct TexturedSurface::Learned : SurfacePlace {
  float brightness = 0;  ///< under a light of one, against the other places
  float variance = 0;    ///< of the brightness
  int seen = 0;          ///< times
  int missed = 0;        ///< times in a row that something else was seen
};

struct TexturedSurface::Views {
  std::array<DepthView, 2> eyes;
  PlacedBody body;
};

TexturedSurface::TexturedSurface(const ObjectModel& object, const RectifiedStereoCamera& camera)
    : camera_(camera),
      said_(object.textured),
      triangles_(object.mesh.triangles),
      views_(std::make_unique<Views>()) {
  vertices_.reserve(object.mesh.vertices.size());
  for (const Eigen::Vector3d& vertex : object.mesh.vertices)
    vertices_.push_back(vertex.cast<float>());
}
TexturedSurface::~TexturedSurface() = default;
TexturedSurface::TexturedSurface(TexturedSurface&&) noexcept = default;

bool TexturedSurface::knows() const { return in_sight_.size() >= kEnough; }

void TexturedSurface::forget() {
  learned_.clear();
  cells_.clear();
  in_sight_.clear();
  new_places_.clear();
  cell_ = 0;
}

void TexturedSurface::look(const std::array<EdgeField, 2>& fields, const Pose& camera_from_object) {
  new_places_.clear();
  in_sight_.clear();
  if (!said_.value_or(true) || !fields[0].seen() || !fields[1].seen() || --idle_ >= 0) return;
  const Eigen::Matrix3f rotation = camera_from_object.linear().cast<float>();
  const Eigen::Vector3f origin = camera_from_object.translation().cast<float>();
  placeBody(vertices_, triangles_, camera_from_object, views_->body);
  const std::vector<Eigen::Vector3f>& normals = views_->body.normals;
  std::array<DepthView, 2>& seen = views_->eyes;
  for (std::size_t eye = 0; eye < 2; ++eye) {
    drawDepths(views_->body.points, triangles_, camera_,
               eye == 0 ? 0 : static_cast<float>(camera_.baseline), fields[eye].region(), 1,
               seen[eye]);
    if (seen[eye].box.area() <= 0) return;
  }
  findTexture(fields);
  const float least = said_.value_or(false) ? kLeastShare : kClearShare;
  idle_ = 0;
  if (smooth_ < kSmoothPixels || textured_ < least * smooth_) {
    if (smooth_ >= kSmoothPixels && learned_.empty()) idle_ = kIdlePeriod;
    return;
  }
  for (const Spot& spot : spots_) {
    const Eigen::Vector3f at = placeSeen(seen[0], camera_, 0, spot.u, spot.v);
    new_places_.push_back(
        {rotation.transpose() * (at - origin),
         rotation.transpose() *
             normals[static_cast<std::size_t>(seen[0].triangle.at<int>(spot.v, spot.u))]});
  }
  const auto focal = static_cast<float>(camera_.focal_length);
  for (std::size_t i = 0; i < learned_.size(); ++i) {
    if (learned_[i].seen < kFirstLooks) continue;
    const Eigen::Vector3f at = rotation * learned_[i].point + origin;
    if (at.z() < kNearest || (rotation * learned_[i].normal).dot(at.normalized()) > -kLeastFacing)
      continue;
    const int u =
        cvRound(static_cast<float>(camera_.center_u) + focal * at.x() / at.z()) - seen[0].box.x;
    const int v =
        cvRound(static_cast<float>(camera_.center_v) + focal * at.y() / at.z()) - seen[0].box.y;
    if (smoothAround(seen[0], normals, u, v) &&
        std::abs(seen[0].nearness.at<float>(v, u) * at.z() - 1) < kHiddenStep && bothSee(u, v))
      in_sight_.push_back(i);
  }
  // As many as are enough, from all over the surface.
  if (in_sight_.size() <= kMostInSight) return;
  const std::size_t all = in_sight_.size();
  for (std::size_t i = 0; i < kMostInSight; ++i) in_sight_[i] = in_sight_[i * all / kMostInSight];
  in_sight_.resize(kMostInSight);
}

/// Whether the right eye too sees what a pixel of the left eye's view shows.
bool TexturedSurface::bothSee(int u, int v) const {
  const auto& [left, right] = views_->eyes;
  const float near = left.nearness.at<float>(v, u);
  const float disparity = static_cast<float>(camera_.focal_length * camera_.baseline) * near;
  const int other_u = cvRound(static_cast<float>(u + left.box.x) - disparity) - right.box.x;
  const int other_v = v + left.box.y - right.box.y;
  return smoothAround(right, views_->body.normals, other_u, other_v) &&
         std::abs(right.nearness.at<float>(other_v, other_u) - near) < kHiddenStep * near;
}

/// Textured pixels of the left eye's view, the strongest ones of each cell; counts which share of
/// the smooth surface they are.
void TexturedSurface::findTexture(const std::array<EdgeField, 2>& fields) {
  spots_.clear();
  const DepthView& seen = views_->eyes[0];
  const SmoothImage right(fields[1]);
  thread_local std::vector<Spot> found;
  found.clear();
  smooth_ *= kForgetting;
  textured_ *= kForgetting;
  const cv::Mat& smooth = fields[0].smooth();
  const cv::Point shift = seen.box.tl() - fields[0].region().tl();
  const int first_u = std::max(0, 1 - shift.x), first_v = std::max(0, 1 - shift.y);
  const int last_u = std::min(seen.box.width, smooth.cols - 1 - shift.x);
  const int last_v = std::min(seen.box.height, smooth.rows - 1 - shift.y);
  for (int v = first_v; v < last_v; ++v) {
    const auto* nearness = seen.nearness.ptr<float>(v);
    const auto* here = smooth.ptr<std::int16_t>(v + shift.y) + shift.x;
    const auto* above = smooth.ptr<std::int16_t>(v + shift.y - 1) + shift.x;
    const auto* below = smooth.ptr<std::int16_t>(v + shift.y + 1) + shift.x;
    for (int u = first_u; u < last_u; ++u) {
      if (nearness[u] <= 0) continue;
      // Some pixels tell the share.
      const bool counts =
          u % kCountEvery == 0 && v % kCountEvery == 0 &&
          smoothAround(seen, views_->body.normals, u, v, kSmoothTurn, kFarFromEdges);
      if (counts) smooth_ += 1;
      const float grey = static_cast<float>(here[u]) / 16;
      const float slope = std::hypot(static_cast<float>(here[u + 1] - here[u - 1]),
                                     static_cast<float>(below[u] - above[u])) /
                          32;
      if (slope < kSlopeOnFlat * grey || grey > kSaturated) continue;
      const float noise = fields[0].slopeNoise(grey);
      if (slope < kTextureNoise * noise ||
          !smoothAround(seen, views_->body.normals, u, v,
                        slope < kSlopeOnCurved * grey ? kFlatTurn : kSmoothTurn) ||
          !bothSee(u, v))
        continue;
      const float other_u =
          static_cast<float>(u + seen.box.x) -
          static_cast<float>(camera_.focal_length * camera_.baseline) * nearness[u];
      const auto other_v = static_cast<float>(v + seen.box.y);
      if (!right.contains(other_u, other_v) ||
          std::abs(right(other_u, other_v) - grey) > kUnlikeEyes * grey + kTextureNoise * noise)
        continue;
      if (counts) textured_ += 1;
      found.push_back({u, v, slope});
    }
  }
  if (found.size() < kFewest) return;
  int cell = 1;
  while (found.size() > kMost * static_cast<std::size_t>(cell * cell)) ++cell;
  std::sort(found.begin(), found.end(), [](const Spot& a, const Spot& b) {
    return std::tie(b.slope, a.v, a.u) < std::tie(a.slope, b.v, b.u);
  });
  const int columns = seen.box.width / cell + 1;
  thread_local std::vector<bool> taken;
  taken.assign(static_cast<std::size_t>((seen.box.height / cell + 1) * columns), false);
  for (const Spot& spot : found) {
    auto known = taken[static_cast<std::size_t>(spot.v / cell * columns + spot.u / cell)];
    if (!known) spots_.push_back(spot);
    known = true;
    if (spots_.size() >= kMost) break;
  }
}

/// What one eye sees of learned places.
void TexturedSurface::sample(const EdgeField& field, int eye,
                             const std::vector<std::size_t>& indices,
                             const Pose& camera_from_object,
                             std::vector<SurfaceSample>& samples) const {
  samples.clear();
  const SmoothImage image(field);
  const Eigen::Matrix3f rotation = camera_from_object.linear().cast<float>();
  const Eigen::Vector3f origin = camera_from_object.translation().cast<float>();
  const auto focal = static_cast<float>(camera_.focal_length);
  const Eigen::Vector3f eye_place(eye == 0 ? 0 : static_cast<float>(camera_.baseline), 0, 0);
  for (const std::size_t index : indices) {
    const Learned& place = learned_[index];
    SurfaceSample s;
    s.index = index;
    s.arm = rotation * place.point;
    const Eigen::Vector3f at = origin + s.arm - eye_place;
    if (at.z() < kNearest) continue;
    s.offset << static_cast<float>(camera_.center_u) + focal * at.x() / at.z(),
        static_cast<float>(camera_.center_v) + focal * at.y() / at.z();
    if (!image.contains(s.offset.x(), s.offset.y())) continue;
    s.seen = image(s.offset.x(), s.offset.y());
    if (s.seen > kSaturated) continue;
    s.light = shadingAt(origin + s.arm, rotation * place.normal, camera_.baseline);
    s.expected = place.brightness * s.light;
    const Eigen::Vector2f slope = image.slope(s.offset.x(), s.offset.y());
    s.slope = slopeByPlace(slope, at, focal);
    s.moved = 0.5F * slope.squaredNorm();
    s.own_variance = varianceOf(field, s.seen, slope, kAgainstKnown, 1);
    s.variance = s.own_variance;
    if (place.brightness > 0)
      s.variance += place.variance * std::pow(s.seen / place.brightness, 2.0F);
    samples.push_back(s);
  }
  centre(samples);
}

void TexturedSurface::learn(const std::array<EdgeField, 2>& fields,
                            const Pose& camera_from_object) {
  if (new_places_.empty() && in_sight_.empty()) return;
  if (cell_ <= 0)
    cell_ = kCellPixels *
            static_cast<float>(camera_from_object.translation().z() / camera_.focal_length);
  const auto cellOf = [&](const Eigen::Vector3f& point) {
    std::uint64_t key = 0;
    for (const float x : {point.x(), point.y(), point.z()})
      key = key << 20 | static_cast<std::uint64_t>(std::floor(x / cell_) + (1 << 19));
    return key;
  };
  for (const SurfacePlace& place : new_places_) {
    if (learned_.size() >= kMostLearned || !cells_.insert(cellOf(place.point)).second) continue;
    Learned learned;
    learned.point = place.point;
    learned.normal = place.normal;
    learned_.push_back(learned);
  }
  thread_local std::vector<std::size_t> places;
  places.assign(in_sight_.begin(), in_sight_.end());
  for (std::size_t i = 0; i < learned_.size(); ++i) {
    if (learned_[i].seen >= kFirstLooks) continue;
    const Eigen::Vector3f ray =
        (camera_from_object * learned_[i].point.cast<double>()).normalized().cast<float>();
    const Eigen::Vector3f normal = camera_from_object.linear().cast<float>() * learned_[i].normal;
    if (normal.dot(ray) < -kLeastFacing) places.push_back(i);
  }
  thread_local std::vector<SurfaceSample> samples, known;
  for (int eye = 0; eye < 2; ++eye) {
    sample(fields[static_cast<std::size_t>(eye)], eye, places, camera_from_object, samples);
    if (samples.size() < kFewest) continue;
    known.clear();
    for (const SurfaceSample& s : samples)
      if (learned_[s.index].seen >= kFirstLooks) known.push_back(s);
    Eigen::Vector3f gain = Eigen::Vector3f::Zero();
    if (known.size() >= kFewest) {
      gain = fitGain(known);
    } else {
      float seen = 0, light = 0;
      for (const SurfaceSample& s : samples) seen += s.seen, light += s.light;
      gain.x() = seen / light;
    }
    for (const SurfaceSample& s : samples) {
      const float light = gain.dot(gainColumn(s)) * s.light;
      if (light > 0) update(learned_[s.index], s.seen / light, s.own_variance / (light * light));
    }
  }
}

void TexturedSurface::update(Learned& place, float brightness, float noise) {
  const float apart = brightness - place.brightness;
  if (place.seen > 2 * kFirstLooks &&
      apart * apart > 16 * (place.variance + noise)) {  // something hides it
    if (++place.missed < kPatience) return;
    place.seen = 0;
  }
  place.missed = 0;
  if (place.seen++ == 0) {
    place.brightness = brightness;
    place.variance = std::pow(kFirstSpread * brightness, 2.0F);
    return;
  }
  const float rate = std::max(1 / static_cast<float>(place.seen), kLeastRate);
  place.brightness += rate * apart;
  place.variance +=
      std::max(rate, kSpreadRate) * (std::max(0.0F, apart * apart - noise) - place.variance);
}

SurfaceEvidence TexturedSurface::evidence(const std::array<EdgeField, 2>& fields,
                                          const Pose& camera_from_object) const {
  return knows() ? compareWithKnown(fields, camera_from_object)
                 : compareEyes(fields, camera_from_object);
}

SurfaceEvidence TexturedSurface::compareEyes(const std::array<EdgeField, 2>& fields,
                                             const Pose& camera_from_object) const {
  SurfaceEvidence evidence;
  if (new_places_.empty()) return evidence;
  thread_local std::vector<SurfaceSample> samples;
  samples.clear();
  const SmoothImage left(fields[0]), right(fields[1]);
  const Eigen::Matrix3f rotation = camera_from_object.linear().cast<float>();
  const Eigen::Vector3f origin = camera_from_object.translation().cast<float>();
  const auto focal = static_cast<float>(camera_.focal_length);
  const Eigen::Vector3f baseline(static_cast<float>(camera_.baseline), 0, 0);
  thread_local std::vector<Eigen::Vector3f> other_slopes;  // by the place
  other_slopes.clear();
  for (const SurfacePlace& place : new_places_) {
    SurfaceSample s;
    s.arm = rotation * place.point;
    const Eigen::Vector3f at = origin + s.arm;
    if (at.z() < kNearest) continue;
    const float u = static_cast<float>(camera_.center_u) + focal * at.x() / at.z();
    const float v = static_cast<float>(camera_.center_v) + focal * at.y() / at.z();
    const float other_u = u - focal * baseline.x() / at.z();
    if (!left.contains(u, v) || !right.contains(other_u, v)) continue;
    s.seen = left(u, v);
    s.expected = right(other_u, v);
    if (s.seen > kSaturated || s.expected > kSaturated) continue;
    const Eigen::Vector2f slope = left.slope(u, v);
    s.slope = slopeByPlace(slope, at, focal);
    other_slopes.push_back(slopeByPlace(right.slope(other_u, v), at - baseline, focal));
    s.moved = slope.x() * slope.x();
    s.variance = varianceOf(fields[0], s.seen, slope, kBetweenEyes, 2);
    s.offset << u, v;
    samples.push_back(s);
  }
  if (samples.size() < kFewest) return evidence;
  centre(samples);
  fitGain(samples);
  for (std::size_t i = 0; i < samples.size(); ++i)
    samples[i].slope -= samples[i].gain * other_slopes[i];
  const double shift = add(samples, evidence);
  limit(shift, kBetweenEyes, evidence);
  return evidence;
}

/// What one eye sees of the learned places in sight against what is expected; none if too few.
void TexturedSurface::compareInSight(const std::array<EdgeField, 2>& fields, int eye,
                                     const Pose& camera_from_object,
                                     std::vector<SurfaceSample>& samples) const {
  sample(fields[static_cast<std::size_t>(eye)], eye, in_sight_, camera_from_object, samples);
  if (samples.size() < kFewest)
    samples.clear();
  else
    fitGain(samples);
}

SurfaceEvidence TexturedSurface::compareWithKnown(const std::array<EdgeField, 2>& fields,
                                                  const Pose& camera_from_object) const {
  SurfaceEvidence evidence;
  thread_local std::vector<SurfaceSample> samples;
  double shift = 0;
  for (int eye = 0; eye < 2; ++eye) {
    compareInSight(fields, eye, camera_from_object, samples);
    shift += add(samples, evidence);
  }
  limit(shift, kAgainstKnown, evidence);
  return evidence;
}

double TexturedSurface::support(const std::array<EdgeField, 2>& fields,
                                const Pose& camera_from_object) const {
  if (!knows()) return 0;
  thread_local std::vector<SurfaceSample> samples;
  double alike = 0;
  for (int eye = 0; eye < 2; ++eye) {
    compareInSight(fields, eye, camera_from_object, samples);
    for (const SurfaceSample& s : samples)
      if (s.gain > kLeastGain && s.residual * s.residual < kOutlier * kOutlier * s.variance)
        alike += 1;
  }
  return alike / (2 * static_cast<double>(in_sight_.size()));
}

}  // namespace leap_object_tracker
