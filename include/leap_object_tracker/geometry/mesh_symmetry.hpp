#pragma once

#include "leap_object_tracker/geometry/mesh.hpp"
#include "leap_object_tracker/geometry/symmetry.hpp"

namespace leap_object_tracker {

/// The turns about the origin that bring a mesh to itself: axes of up to 12 equal turns or of any.
///
/// An axis of symmetry is a principal axis of the surface's second moments: such directions are
/// tried, and moved to where the turned surface lies nearest to itself. No point may then be
/// farther off than 1.5 % of the radius: smaller differences hardly show. Where a body has several
/// axes of many turns and is not aligned with its frame (an oblique cube), the one of most turns
/// and one across are taken. Takes some 0.1 s.
Symmetry symmetryOf(const Mesh& mesh);

}  // namespace leap_object_tracker
