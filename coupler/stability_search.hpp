// Maps where a scene is stable: a run for each cell of the grid, or the limit of one key by bisection in
// each.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stability_verdict.hpp"
#include "study_runner.hpp"

namespace estuary::coupler {

struct StabilityRun {
  StudyResult result;
  StabilityVerdict verdict;
};

/// Of one cell of the grid. Between `holds` and `fails` lies the limit; one is absent when the whole interval
/// fails or holds.
struct StabilityLimit {
  StudyCell cell;
  std::optional<double> holds;
  std::optional<double> fails;
  StabilityVerdict beyond;  // of the run at `fails`
};

struct StabilityMap {
  std::vector<StudyQuantity> quantities;
  std::vector<StabilityRun> runs;      // in the order of the grid, within a cell by the bisected value
  std::vector<StabilityLimit> limits;  // empty without [bisect]
};

/// Brings a cell to one run, or leaves it as it is (interrupted, or only what is there is wanted).
using ObtainRun = std::function<void(PreparedCell&)>;

/// The runs of the cell of the grid at `steps`: one, or those of a bisection.
StabilityMap search_cell(const StudyScene& study, const StudyStore& store,
                         const std::vector<std::size_t>& steps, const std::vector<StudyQuantity>& quantities,
                         const ObtainRun& obtain);

/// Value halfway between, on the bisection's scale.
double middle_of(const StudyBisection& bisection, double holds, double fails);
/// The limit is known well enough.
bool resolved(const StudyBisection& bisection, double holds, double fails);

}  // namespace estuary::coupler
