// Pictures of a solid's particles or of grains in their first and their last frame.
#pragma once

#include <filesystem>
#include <string>

#include "flow_picture.hpp"
#include "gnuplot.hpp"

namespace estuary::coupler {

/// Reads the first and the last frame of `role` ("solid" or "grains") below `run_folder` and draws both to
/// one scale: a solid's particles by von Mises stress (by displacement where there is none), grains by their
/// speed and with their radii. Throws std::runtime_error with a sentence for the reader when there is nothing
/// to draw.
Picture draw_particles(const std::filesystem::path& run_folder, const std::string& role,
                       const std::filesystem::path& picture, bool steady, const Gnuplot& gnuplot);

}  // namespace estuary::coupler
