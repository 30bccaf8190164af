#pragma once

#include <cstddef>
#include <cstdint>

namespace leap_object_tracker {

/// Takes `pixels` pairs apart: even bytes to `left`, odd bytes to `right`, with the widest vector
/// instructions of this processor.
void splitEyes(const std::uint8_t* interleaved, std::size_t pixels, std::uint8_t* left,
               std::uint8_t* right);

}  // namespace leap_object_tracker
