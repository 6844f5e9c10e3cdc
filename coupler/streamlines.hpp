// Streamlines of a plane flow, spread evenly: no two come closer than one cell of a coarse grid (in the
// manner of Jobard & Lefer 1997, Creating evenly-spaced streamlines of arbitrary density).
#pragma once

#include <cstddef>
#include <vector>

#include "frame_reader.hpp"

namespace estuary::coupler {

struct Streamline {
  std::vector<double> points;  // x y of each [m], in the direction of the flow
};

/// Velocity of `image`'s field "velocity" is followed with the midpoint rule. Lines end at the border, where
/// `blocked` (one per point of the image) holds, where the flow is slower than a thousandth of its maximum,
/// and near another line. `separation` is the width of a cell of the coarse grid [m].
std::vector<Streamline> streamlines(const ImageFrame& image, const std::vector<bool>& blocked,
                                    double separation);

}  // namespace estuary::coupler
