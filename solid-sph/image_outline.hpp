// Bodies from pictures: the contours of what is solid in a grey image.
//
// Marching squares with linear interpolation between the centres of pixels (Lorensen & Cline 1987, in the
// plane), so that grey edges are met to a fraction of a pixel; then points one spacing apart, each the mean
// of the contour over a spacing, which takes the staircase of black and white pictures away and rounds
// corners by that much.
#pragma once

#include <array>
#include <vector>

#include "image_file.hpp"
#include "outline_filling.hpp"

namespace estuary::solid {

struct ImageMap {
  std::array<double, 2> corner{};  // lower left of the picture [m]
  double pixel = 0;                // width of a pixel [m]
  double threshold = 128;          // brightness that parts solid from void
  bool dark = true;                // what is darker is solid
  bool flip_x = false, flip_y = false;
};

/// Every connected solid region with its holes (outer loop first, counter-clockwise), the largest first;
/// those and holes below `smallest_area` [m2] are left out. Points are `spacing` apart.
std::vector<std::vector<Polygon>> outlines_in_image(const GreyImage& image, const ImageMap& map,
                                                    double spacing, double smallest_area);

}  // namespace estuary::solid
