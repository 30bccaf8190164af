#include "leap_object_tracker/tracking/particle_filter.hpp"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <cmath>

#include "drawn_box.hpp"
#include "leap_object_tracker/tracking/contour_kernel.hpp"
#include "leap_object_tracker/tracking/pose_refiner.hpp"

namespace leap_object_tracker {
namespace {

TEST(NormalNumbers, haveMeanZeroVarianceOneAndNoCorrelation) {
  constexpr int kCount = 100000;
  Twist sum = Twist::Zero();
  Matrix6d products = Matrix6d::Zero();
  double fourth = 0;
  for (int i = 0; i < kCount; ++i) {
    const auto numbers = normalsOf({7, 3}, static_cast<std::uint32_t>(i));
    const Twist x = Eigen::Map<const Eigen::Matrix<float, 6, 1>>(numbers.data()).cast<double>();
    sum += x;
    products += x * x.transpose();
    fourth += x.array().square().square().mean();
  }
  // Five standard deviations of each figure.
  EXPECT_LT((sum / kCount).cwiseAbs().maxCoeff(), 5 / std::sqrt(kCount));
  EXPECT_LT((products / kCount - Matrix6d::Identity()).cwiseAbs().maxCoeff(),
            5 * std::sqrt(2.0 / kCount));
  EXPECT_NEAR(fourth / kCount, 3, 5 * std::sqrt(96.0 / (6 * kCount)));
}

TEST(NormalNumbers, differBetweenSeedsDrawsAndParticles) {
  const auto numbers = normalsOf({1, 1}, 1);
  EXPECT_EQ(numbers, normalsOf({1, 1}, 1));
  EXPECT_NE(numbers, normalsOf({2, 1}, 1));
  EXPECT_NE(numbers, normalsOf({1, 2}, 1));
  EXPECT_NE(numbers, normalsOf({1, 1}, 2));
}

TEST(NormalNumbers, areTheSameWithEveryInstructionSet) {
  const auto reference = normalsOf({5, 9}, 1234);
  for (const std::string& target : contourKernelTargets()) {
    useContourKernelTarget(target);
    const auto numbers = normalsOf({5, 9}, 1234);
    for (std::size_t k = 0; k < 6; ++k) EXPECT_NEAR(numbers[k], reference[k], 1e-5) << target;
  }
  useContourKernelTarget("");
}

FilterParams particles(int count) {
  FilterParams params;
  params.particles = count;
  return params;
}

Matrix6d diagonal(double position, double rotation) {
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal() << Eigen::Vector3d::Constant(position * position),
      Eigen::Vector3d::Constant(rotation * rotation);
  return covariance;
}

/// Mean and covariance of the particles' twists from a pose.
std::pair<Twist, Matrix6d> momentsOf(const ParticleFilter& filter, const Pose& from) {
  Twist sum = Twist::Zero();
  Matrix6d products = Matrix6d::Zero();
  for (const ParticlePose& particle : filter.poses()) {
    const Twist twist = cameraTwistBetween(from, toPose(particle));
    sum += twist;
    products += twist * twist.transpose();
  }
  const auto count = static_cast<double>(filter.poses().size());
  return {sum / count, products / count - sum * sum.transpose() / (count * count)};
}

TEST(ParticleFilter, drawsParticlesOfTheMeanAndCovarianceAskedFor) {
  const Pose mean = poseAt(0.01, -0.02, 0.15);
  Matrix6d covariance = diagonal(0.002, 0.1);
  covariance(0, 4) = covariance(4, 0) = 0.5 * 0.002 * 0.1;
  ParticleFilter filter(particles(20000));
  filter.initialize(mean, covariance, Twist::Zero(), Matrix6d::Zero());
  const auto [found_mean, found] = momentsOf(filter, mean);
  const Twist scale = covariance.diagonal().cwiseSqrt();
  EXPECT_LT(found_mean.cwiseQuotient(scale).cwiseAbs().maxCoeff(), 0.04);
  const Matrix6d ratio =
      scale.cwiseInverse().asDiagonal() * (found - covariance) * scale.cwiseInverse().asDiagonal();
  EXPECT_LT(ratio.cwiseAbs().maxCoeff(), 0.05);
}

TEST(ParticleFilter, movesParticlesWithTheirVelocityAndWithTheCamera) {
  const Pose start = poseAt(0, 0, 0.2);
  Twist velocity;
  velocity << 0.1, -0.2, 0.3, 1, -2, 3;
  MotionParams still;
  still.linear_acceleration = still.angular_acceleration = 0;
  ParticleFilter filter(particles(10));
  filter.initialize(start, Matrix6d::Zero(), velocity, Matrix6d::Zero());
  Pose camera_motion = Pose::Identity();
  camera_motion.linear() = rotationFromVector({0, 0, M_PI / 2});  // x becomes y
  camera_motion.translation() << 0.01, 0.02, 0.03;
  filter.predict(still, 0.1, camera_motion);
  Twist turned;
  turned << 0.2, 0.1, 0.3, 2, 1, 3;
  const Pose expected = movedInCamera(camera_motion * start, turned * 0.1);
  for (const ParticlePose& particle : filter.poses())
    EXPECT_LT(cameraTwistBetween(expected, toPose(particle)).norm(), 1e-5);
}

TEST(ParticleFilter, spreadsParticlesAsTheAccelerationSays) {
  const Pose start = poseAt(0, 0, 0.2);
  MotionParams motion;
  motion.linear_acceleration = 8;
  motion.angular_acceleration = 60;
  ParticleFilter filter(particles(20000));
  filter.initialize(start, Matrix6d::Zero(), Twist::Zero(), Matrix6d::Zero());
  filter.predict(motion, 0.05, Pose::Identity());
  const Matrix6d found = momentsOf(filter, start).second;
  for (int k = 0; k < 6; ++k)
    EXPECT_NEAR(std::sqrt(found(k, k)) / ((k < 3 ? 8 : 60) * 0.5 * 0.05 * 0.05), 1, 0.03) << k;
}

/// As if the object were at x = 0.001 m, with a standard deviation of 0.5 mm.
void likesOneMillimetre(const ParticlePose* poses, std::size_t count, float* log_likelihood) {
  for (std::size_t i = 0; i < count; ++i) {
    const float off = (poses[i].translation[0] - 0.001F) / 0.0005F;
    log_likelihood[i] = -0.5F * off * off;
  }
}

TEST(ParticleFilter, resamplesToThePosterior) {
  const Pose start = poseAt(0, 0, 0.2);
  ParticleFilter filter(particles(20000));
  filter.initialize(start, diagonal(0.0005, 0.01), Twist::Zero(), Matrix6d::Zero());
  filter.weigh(likesOneMillimetre);
  // (mean of w)^2 / mean of w^2, integrated over the particles.
  const double expected_share = std::sqrt(3.0) / 2 * std::exp(-2 / 3.0);
  EXPECT_NEAR(filter.effectiveShare(), expected_share, 0.01);
  filter.resample(1.01);
  const auto [mean, covariance] = momentsOf(filter, start);
  EXPECT_NEAR(mean[0], 0.0005, 0.00002);
  EXPECT_NEAR(std::sqrt(covariance(0, 0)), 0.0005 / std::sqrt(2.0), 0.00002);
}

TEST(ParticleFilter, thinsALargeSetWithoutChangingThePosterior) {
  const Pose start = poseAt(0, 0, 0.2);
  ParticleFilter filter(particles(100000));
  filter.initialize(start, diagonal(0.0005, 0.01), Twist::Zero(), Matrix6d::Zero());
  filter.anneal(likesOneMillimetre, 0.2, 0);  // more survive at full power
  EXPECT_EQ(filter.poses().size(), ParticleFilter::thinned(100000));
  const auto [mean, covariance] = momentsOf(filter, start);
  EXPECT_NEAR(mean[0], 0.0005, 0.00002);
  EXPECT_NEAR(std::sqrt(covariance(0, 0)), 0.0005 / std::sqrt(2.0), 0.00002);
  MotionParams still;
  still.linear_acceleration = still.angular_acceleration = 0;
  filter.predict(still, 0.01, Pose::Identity());
  EXPECT_EQ(filter.poses().size(), 100000u);
  const auto [spread_mean, spread] = momentsOf(filter, start);
  EXPECT_NEAR(spread_mean[0], mean[0], 1e-6);
  EXPECT_NEAR(std::sqrt(spread(0, 0)), std::sqrt(covariance(0, 0)), 1e-6);
}

TEST(ParticleFilter, annealsToTheShareThatShallSurvive) {
  ParticleFilter filter(particles(10000));
  filter.initialize(poseAt(0, 0, 0.2), diagonal(0.01, 0.01), Twist::Zero(), Matrix6d::Zero());
  filter.anneal(likesOneMillimetre, 0.2, 0.4);
  EXPECT_NEAR(filter.effectiveShare(), 0.2, 0.02);
}

TEST(ParticleFilter, isTheSameWhateverTheNumberOfThreads) {
  std::vector<ParticlePose> reference;
  for (const int threads : {1, 2, 4}) {
    ParticleFilter filter(particles(50000));
    tbb::task_arena arena(threads);
    arena.execute([&] {
      filter.initialize(poseAt(0, 0, 0.2), diagonal(0.01, 0.01), Twist::Zero(), diagonal(0.1, 1));
      for (int frame = 0; frame < 3; ++frame) {
        filter.predict({}, 0.01, Pose::Identity());
        filter.anneal(likesOneMillimetre, 0.2, 0.4);
        filter.weigh(likesOneMillimetre);
        filter.resample(0.9);
        filter.inject(0.5, poseAt(0, 0, 0.2), diagonal(0.001, 0.01), Twist::Zero(),
                      diagonal(0.1, 1));
      }
    });
    if (reference.empty()) reference.assign(filter.poses().begin(), filter.poses().end());
    for (std::size_t i = 0; i < reference.size(); ++i) {
      ASSERT_EQ(reference[i].rotation, filter.poses()[i].rotation) << threads << " threads";
      ASSERT_EQ(reference[i].translation, filter.poses()[i].translation) << threads << " threads";
    }
  }
}

TEST(ParticleFilter, keepsRotationsAfterManyFrames) {
  ParticleFilter filter(particles(100));
  filter.initialize(poseAt(0, 0, 0.2), diagonal(0.01, 0.5), Twist::Zero(), diagonal(0.1, 5));
  for (int frame = 0; frame < 1000; ++frame) filter.predict({}, 0.01, Pose::Identity());
  for (const ParticlePose& particle : filter.poses()) {
    Eigen::Matrix3f rotation;
    for (int k = 0; k < 9; ++k) rotation(k / 3, k % 3) = particle.rotation[std::size_t(k)];
    EXPECT_LT((rotation * rotation.transpose() - Eigen::Matrix3f::Identity()).norm(), 1e-5F);
    EXPECT_GT(rotation.determinant(), 0);
  }
}

}  // namespace
}  // namespace leap_object_tracker
