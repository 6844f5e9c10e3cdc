// Bodies that pass through each other: do lines of the wet surface cross where they have moved to?
//
// A steady run knows no contact, so its equilibrium may have one trabecula inside another. Looked for in two
// dimensions, in steady mode, after each iteration, where bodies can meet: where the wet surface has more
// than one line and none crosses at rest (`bodies_can_meet`). A fin's or a bar's single line is left out.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "estuary/v1/payload.pb.h"

namespace estuary::coupler {

/// Two facets that cross: the first node of each and where they do [m].
struct WetCrossing {
  std::array<std::uint32_t, 2> nodes{};
  std::array<double, 2> place{};
};

/// Whether facets of this surface hang together in more than one line, none of which crosses at rest; false
/// in three dimensions.
bool bodies_can_meet(const v1::WetSurface& surface);

/// A crossing of the facets of a wet surface in two dimensions, moved by `displacement` (nodes x 2) [m]; none
/// in three. Facets that share a node or that only touch do not cross: each has to reach beyond the other to
/// both sides, by 1e-9 of the longer one's length. Facets are compared in cells of a size near their own, a
/// grid for each power of two among their lengths, so the cost is that of the facets times the number of such
/// lengths, whatever they are.
std::optional<WetCrossing> find_crossing(const v1::WetSurface& surface, std::span<const double> displacement);

}  // namespace estuary::coupler
