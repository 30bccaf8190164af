#pragma once

#include <cstddef>
#include <cstdint>

namespace leap_object_tracker {

/// Sums what a map holds at `offsets`, each moved by the place of a particle, for `particles`
/// particles: the lookups of the scoring kernel and nothing else. The instruction set is the one
/// that useContourKernelTarget() chose.
/// @param count a multiple of 16
/// @param moves [cells] one a particle
std::int64_t gatherOnly(const std::uint8_t* map, const std::int32_t* offsets, std::size_t count,
                        const std::int32_t* moves, std::size_t particles);

}  // namespace leap_object_tracker
