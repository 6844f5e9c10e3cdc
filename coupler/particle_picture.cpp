#include "particle_picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "frame_reader.hpp"

namespace estuary::coupler {
namespace {

constexpr std::size_t most_particles = 20000;  // more than a picture of this size shows

struct Shown {
  std::string label;
  std::vector<double> value;   // one per particle
  std::vector<double> radius;  // [m]
};

std::vector<double> magnitude(const FrameField& field) {
  std::vector<double> result(field.values.size() / field.components);
  for (std::size_t i = 0; i < result.size(); ++i) {
    double square = 0;
    for (std::size_t c = 0; c < field.components; ++c)
      square += field.values[i * field.components + c] * field.values[i * field.components + c];
    result[i] = std::sqrt(square);
  }
  return result;
}

/// Half the median distance to the nearest neighbour, a little more so that a body shows no gaps.
double radius_of_particles(const std::vector<double>& positions) {
  const std::size_t count = positions.size() / 2;
  std::vector<double> distances;
  for (std::size_t i = 0; i < count; i += std::max<std::size_t>(1, count / 64)) {
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t j = 0; j < count; ++j) {
      if (j != i)
        nearest = std::min(nearest, std::hypot(positions[2 * i] - positions[2 * j],
                                               positions[2 * i + 1] - positions[2 * j + 1]));
    }
    distances.push_back(nearest);
  }
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return 0.62 * *middle;
}

/// Not in fluids and rigid bodies.
bool bears_shear(const PointFrame& frame) {
  const auto stress = frame.fields.find("von_mises");
  return stress != frame.fields.end() &&
         std::any_of(stress->second.values.begin(), stress->second.values.end(),
                     [](double value) { return value != 0; });
}

/// `with_stress`: coloured by the stress where there is one, not by the motion.
Shown shown_of(const PointFrame& frame, bool with_stress) {
  const std::size_t count = frame.positions.size() / 2;
  const auto field = [&](const char* name) {
    const auto found = frame.fields.find(name);
    return found == frame.fields.end() ? nullptr : &found->second;
  };
  Shown shown;
  if (const auto* stress = field("von_mises"); stress != nullptr && with_stress) {
    shown.label = "von Mises stress [Pa]";
    shown.value = magnitude(*stress);
  } else if (const auto* velocity = field("velocity"); velocity != nullptr) {
    shown.label = "speed [m/s]";
    shown.value = magnitude(*velocity);
  } else if (const auto* displacement = field("displacement"); displacement != nullptr) {
    shown.label = "displacement [m]";
    shown.value = magnitude(*displacement);
  }
  shown.value.resize(count, 0.0);
  if (const auto* radius = field("radius")) {
    shown.radius = magnitude(*radius);
    shown.radius.resize(count, 0.0);
  } else {
    shown.radius.assign(count, radius_of_particles(frame.positions));
  }
  return shown;
}

struct Box {
  double low[2] = {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  double high[2] = {-std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  void include(const PointFrame& frame, const Shown& shown) {
    for (std::size_t i = 0; i < frame.positions.size(); ++i) {
      low[i % 2] = std::min(low[i % 2], frame.positions[i] - shown.radius[i / 2]);
      high[i % 2] = std::max(high[i % 2], frame.positions[i] + shown.radius[i / 2]);
    }
  }
};

std::string block(const std::string& name, const PointFrame& frame, const Shown& shown) {
  const std::size_t count = frame.positions.size() / 2;
  const std::size_t stride = (count + most_particles - 1) / most_particles;
  std::string text = fmt::format("${} << END\n", name);
  for (std::size_t i = 0; i < count; i += std::max<std::size_t>(1, stride)) {
    text += fmt::format("{:.9g} {:.9g} {:.9g} {:.9g}\n", frame.positions[2 * i], frame.positions[2 * i + 1],
                        shown.radius[i], shown.value[i]);
  }
  return text + "END\n";
}

std::string time_text(const NamedFrame& frame, bool steady) {
  return steady ? fmt::format("iteration {:.6g}", frame.time) : fmt::format("t = {:.6g} s", frame.time);
}

}  // namespace

Picture draw_particles(const std::filesystem::path& run_folder, const std::string& role,
                       const std::filesystem::path& picture, bool steady, const Gnuplot& gnuplot) {
  const auto last = last_frame(run_folder / role, "frame");
  if (!last) throw std::runtime_error(fmt::format("{} left no frames.", role));
  auto first = first_frame(run_folder / role, "frame");
  if (first && first->file == last->file) first.reset();
  const PointFrame end = read_point_frame(last->file);
  if (end.positions.size() < 4) throw std::runtime_error(fmt::format("The last frame of {} is empty.", role));
  const bool with_stress = role == "solid" && bears_shear(end);
  const Shown shown = shown_of(end, with_stress);
  Box box;
  box.include(end, shown);
  std::string data = block("last", end, shown);
  double most = *std::max_element(shown.value.begin(), shown.value.end());
  if (first) {
    const PointFrame begin = read_point_frame(first->file);
    const Shown begin_shown = shown_of(begin, with_stress);
    box.include(begin, begin_shown);
    data += block("first", begin, begin_shown);
    if (!begin_shown.value.empty())
      most = std::max(most, *std::max_element(begin_shown.value.begin(), begin_shown.value.end()));
  }
  const double width = box.high[0] - box.low[0];
  const double height = box.high[1] - box.low[1];
  if (!std::isfinite(width) || !std::isfinite(height) || !(width > 0) || !(height > 0) ||
      !std::isfinite(most))
    throw std::runtime_error(fmt::format("The frames of {} hold no finite places to draw.", role));
  // Side by side what is high, one above the other what is wide.
  const bool beside = first && height > 0.6 * width;
  constexpr double longest = 560;  // pixels of a panel's longer side
  const double scale = longest / std::max(width, height);
  const double panel_width = std::max(260.0, scale * width) + 190;
  const double panel_height = std::max(90.0, scale * height) + 100;
  const double columns = beside ? 2 : 1;
  const double rows = first && !beside ? 2 : 1;
  std::string script =
      data +
      fmt::format(
          "set multiplot layout {:.0f},{:.0f}\nunset key\nset size ratio -1\nset lmargin 9\nset rmargin "
          "18\nset xlabel 'x [m]'\nset ylabel 'y [m]'\nset border lc rgb "
          "'#606060'\nset tics out nomirror scale 0.5\n",
          rows, columns) +
      "set palette defined (0 '#440154', 1 '#3b528b', 2 '#21918c', 3 '#5ec962', 4 '#fde725')\n" +
      fmt::format("set cbrange [0:{:.6g}]\nset format cb '%.4g'\nset cblabel {} offset 3\n",
                  most > 0 ? most : 1.0, Gnuplot::quoted(shown.label)) +
      fmt::format("set xrange [{:.9g}:{:.9g}]\nset yrange [{:.9g}:{:.9g}]\nset xtics {:.3g}\n",
                  box.low[0] - 0.02 * width, box.high[0] + 0.02 * width, box.low[1] - 0.02 * height,
                  box.high[1] + 0.02 * height, std::pow(10, std::floor(std::log10(width))) / 2);
  const std::string circles = " using 1:2:3:4 with circles fs solid 1.0 noborder palette\n";
  if (first)
    script += fmt::format("set title {}\nplot $first{}", Gnuplot::quoted(time_text(*first, steady)), circles);
  script += fmt::format("set title {}\nplot $last{}unset multiplot\n",
                        Gnuplot::quoted(time_text(*last, steady)), circles);
  gnuplot.draw(picture,
               fmt::format("pngcairo size {:.0f},{:.0f} font 'Sans,11' background rgb 'white'",
                           columns * panel_width, rows * panel_height),
               script);
  return {.file = picture,
          .caption = fmt::format("{}{}, {}.", role == "grains" ? "Grains" : "Particles of the solid",
                                 shown.label.empty() ? "" : " by " + shown.label,
                                 first ? "first and last frame" : "last frame")};
}

}  // namespace estuary::coupler
