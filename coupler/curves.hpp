// Plots of series of numbers as vector pictures.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "gnuplot.hpp"

namespace estuary::coupler {

struct Curve {
  std::string name;
  std::vector<double> x;
  std::vector<double> y;  // a value that is not finite breaks the line
};

struct CurvePlot {
  std::string x_label;
  std::string y_label;
  bool logarithmic = false;  // values that are not positive are left out
  std::vector<Curve> curves;
  std::vector<std::pair<std::string, double>> levels;  // name and place of horizontal lines
  unsigned width = 480;
  unsigned height = 290;
};

/// Draws an SVG picture. Throws std::runtime_error when no finite value is left to draw or gnuplot fails.
void draw_curves(const CurvePlot& plot, const std::filesystem::path& picture, const Gnuplot& gnuplot);

}  // namespace estuary::coupler
