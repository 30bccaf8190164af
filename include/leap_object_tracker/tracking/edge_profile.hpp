#pragma once

#include <optional>

namespace leap_object_tracker {

/// Where an edge lies on a profile of grey values across it.
struct ProfileEdge {
  double offset = 0;    ///< [px] from where the edge was expected, along the profile
  double variance = 0;  ///< [px^2] from the noise that the fit left
  double step = 0;      ///< [grey levels] the far side of the edge less the near side
  double noise = 0;     ///< [grey levels] deviation of what the fit left
};

/// Other edges that the profile crosses, as expected [px]; none: infinite.
struct ProfileNeighbours {
  double before = -1e9;
  double after = 1e9;
};

/// Largest half length of a profile [px].
constexpr int kLongestProfile = 7;

/// Fits blurred steps between straight grey ramps to the grey values around an expected edge:
///   I(s) = (a0 + a1 s) (1 - H(s - d)) + (b0 + b1 s) H(s - d),   H(s) = Phi(s / blur),
/// with one more level beyond each neighbouring edge. Linear least squares for levels, ramps and
/// (a0 - b0) d; right for |d| up to about `blur`. Unlike the place of the steepest slope this is
/// free of the pull of ramps and of neighbours that the blur runs together with.
/// @param grey values at first, first + 1, ... count of them, [px] from the expected edge
/// @param blur standard deviation of the point spread across the edge [px]
/// @return nothing where there are too few values or no step above the noise.
std::optional<ProfileEdge> fitProfile(const float* grey, int first, int count, double blur,
                                      const ProfileNeighbours& neighbours);

}  // namespace leap_object_tracker
