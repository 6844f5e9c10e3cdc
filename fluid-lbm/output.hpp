// Frames: the fields on the grid and the wet surface as lines.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "field_file.hpp"
#include "flow.hpp"
#include "units.hpp"

namespace estuary::fluid {

class Output {
public:
  explicit Output(const std::filesystem::path& folder);

  /// Writes frame-*.hdf (velocity [m/s], pressure [Pa], solid: 1 in the solid, the share of the cell in
  /// grains) and, with a wet surface, surface-*.hdf (velocity [m/s], pressure [Pa], traction [Pa]); returns
  /// their names. `fields` and loads in lattice units.
  std::vector<std::string> write(std::uint64_t number, double time, const Flow& flow, const Fields& fields,
                                 const Units& units, const std::vector<double>& pressure,
                                 const std::vector<double>& traction);
  /// One image outside of the series: the fields as they were when the flow diverged. Values that are not
  /// finite become 0.
  std::string write_diverged(const Flow& flow, const Fields& fields, const Units& units) const;

private:
  void write_fields(const std::filesystem::path& file, const Flow& flow, const Fields& fields,
                    const Units& units) const;

  std::filesystem::path folder_;
  FieldSeries frames_;
  FieldSeries surfaces_;
};

}  // namespace estuary::fluid
