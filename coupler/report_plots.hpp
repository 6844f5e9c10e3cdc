// The parts of a report that are drawn: pictures of the fields, convergence, watches. Each says in a sentence
// what it could not draw and goes on.
#pragma once

#include <filesystem>
#include <optional>

#include "gnuplot.hpp"
#include "report_page.hpp"

namespace estuary::coupler {

/// Where a report finds and leaves things.
struct ReportPlaces {
  std::filesystem::path run;       // what the run left
  std::filesystem::path pictures;  // pictures stay here
  std::filesystem::path work;      // removed afterwards
};

/// What the plots need to know of the scene.
struct ReportScene {
  bool steady = false;
  double tolerance = 0;  // of the coupling; 0 when unknown
};

void add_field_pictures(ReportPage& page, const ReportPlaces& places, const ReportScene& scene,
                        const Gnuplot& gnuplot);

/// Residual over the iterations, and sums of forces, moments and power on both sides of the wet surface.
/// Without gnuplot only the numbers.
void add_convergence(ReportPage& page, const ReportPlaces& places, const ReportScene& scene,
                     const std::optional<Gnuplot>& gnuplot);

void add_watches(ReportPage& page, const ReportPlaces& places, const ReportScene& scene,
                 const Gnuplot& gnuplot);

}  // namespace estuary::coupler
