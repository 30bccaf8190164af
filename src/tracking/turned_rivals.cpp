#include "leap_object_tracker/tracking/turned_rivals.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "tracking/best_first.hpp"

namespace leap_object_tracker {
namespace {

constexpr std::size_t kRefined = 6;   // turned poses a look
constexpr std::size_t kCompared = 2;  // of them, as they are exactly seen
constexpr double kApart = 0.25;       // [rad]
constexpr double kHopeless = 80;      // [nats] by which others may be worse at first
constexpr double kMostGain = 15;      // [nats] of contour or shading in one look
// [nats], and this share of all, up to which a difference may be the same at every look.
constexpr double kContourMargin = 15, kContourShare = 0.15, kYoungContourShare = 0.04;
constexpr double kShadedMargin = 4, kShadedShare = 0.03;
constexpr double kLead = 40,
                 kYoungLead = 20;       // [nats] by which a rival must be better over all looks
constexpr double kCredit = 40;          // [nats] that a pose can earn in many looks
constexpr double kLeastSupport = 0.68;  // share of the contour that it must have

/// What of a difference is clear.
double clear(double difference, double own, double margin, double share) {
  if (std::abs(difference) < margin + share * std::abs(own)) return 0;
  return std::clamp(difference, -kMostGain, kMostGain);
}

}  // namespace

TurnedRivals::TurnedRivals(const Symmetry& symmetry, const ContourModel& model,
                           const PoseRefiner& refiner, const ShadedView& shaded_view,
                           double baseline)
    : symmetry_(symmetry),
      baseline_(baseline),
      model_(&model),
      refiner_(&refiner),
      shaded_view_(&shaded_view) {}

void TurnedRivals::forget() {
  rival_.reset();
  lead_ = 0;
}

/// The pose itself and the likeliest turned ones, apart from each other.
std::vector<RefinedPose> TurnedRivals::likeliest(const Pose& pose, const std::vector<Pose>& turned,
                                                 const ContourMeasurement& measurement,
                                                 const Appearance& appearance) const {
  std::vector<ParticlePose> poses;
  for (const Pose& other : turned) poses.push_back(toParticlePose(other));
  std::vector<float> scores(poses.size());
  measurement.score(*model_, ContourMeasurement::Sharpness::kBlunt, poses.data(), poses.size(),
                    scores.data());
  const std::size_t count = std::min(kRefined, scores.size());
  std::vector<std::uint32_t> order;
  putBestFirst(scores, count, order);

  std::vector<Pose> starts;
  for (std::size_t i = 0; i < count; ++i) starts.push_back(turned[order[i]]);
  if (rival_) starts.push_back(pose * *rival_);
  starts.push_back(pose);
  std::vector<RefinedPose> refined(starts.size());
  tbb::parallel_for(std::size_t{0}, refined.size(), [&](std::size_t i) {
    const bool own = i + 1 == refined.size();
    refined[i] =
        refiner_->refine(*model_, measurement.fields(), starts[i], {}, appearance,
                         own ? std::vector<double>{3, 2.5} : std::vector<double>{8, 5, 3, 2.5});
  });
  std::vector<RefinedPose> compared{refined.back()};
  refined.pop_back();
  std::stable_sort(refined.begin(), refined.end(), [](const RefinedPose& a, const RefinedPose& b) {
    return a.log_likelihood > b.log_likelihood;
  });
  for (const RefinedPose& other : refined) {
    if (compared.size() > kCompared ||
        other.log_likelihood < compared.front().log_likelihood - kHopeless)
      break;
    const auto alike = [&](const RefinedPose& known) {
      return angleBetween(other.camera_from_object.linear(), known.camera_from_object.linear(),
                          symmetry_) < kApart;
    };
    if (std::none_of(compared.begin(), compared.end(), alike)) compared.push_back(other);
  }
  return compared;
}

std::optional<Pose> TurnedRivals::look(const Pose& pose, const std::vector<Pose>& turned,
                                       const ContourMeasurement& measurement,
                                       const Appearance& appearance, bool young) {
  if (turned.empty()) return std::nullopt;
  std::vector<RefinedPose> compared = likeliest(pose, turned, measurement, appearance);
  double gain = -kMostGain;
  std::size_t best = 0;
  if (compared.size() > 1) {
    std::vector<double> shaded(compared.size());
    tbb::parallel_for(std::size_t{0}, compared.size(), [&](std::size_t i) {
      refineExactly(*refiner_, *model_, measurement.fields(), baseline_, {}, appearance,
                    compared[i]);
      shaded[i] = shaded_view_->logLikelihood(measurement.fields(), compared[i].camera_from_object);
    });
    const double own = compared.front().log_likelihood;
    for (std::size_t i = 1; i < compared.size(); ++i) {
      double better = clear(compared[i].log_likelihood - own, own, kContourMargin,
                            young ? kYoungContourShare : kContourShare) +
                      clear(shaded[i] - shaded[0], shaded[0], kShadedMargin, kShadedShare);
      if (compared[i].support() < kLeastSupport) better = std::min(better, 0.0);
      if (better < gain) continue;
      gain = better;
      best = i;
    }
  }
  if (best > 0) {
    const Pose turn = pose.inverse() * compared[best].camera_from_object;
    if (!rival_ || angleBetween(rival_->linear(), turn.linear()) > kApart)
      lead_ = std::min(lead_, 0.0);
    rival_ = turn;
  }
  lead_ = std::max(young ? 0.0 : -kCredit, lead_ + gain);
  if (lead_ < (young ? kYoungLead : kLead)) return std::nullopt;
  forget();
  return compared[best].camera_from_object;
}

}  // namespace leap_object_tracker
