#include "flow_picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <optional>
#include <stdexcept>
#include <vector>

#include "frame_reader.hpp"
#include "streamlines.hpp"

namespace estuary::coupler {
namespace {

constexpr double no_value = std::numeric_limits<double>::quiet_NaN();

// Perceptually uniform, readable without colours. viridis and magma: van der Walt & Smith 2015; vik: Crameri
// 2018.
constexpr const char* viridis =
    "(0 '#440154', 1 '#482475', 2 '#414487', 3 '#355f8d', 4 '#2a788e', 5 '#21908d', 6 '#22a884', 7 "
    "'#44bf70', "
    "8 '#7ad151', 9 '#bddf26', 10 '#fde725')";
constexpr const char* magma =
    "(0 '#000004', 1 '#140e36', 2 '#3b0f70', 3 '#641a80', 4 '#8c2981', 5 '#b73779', 6 '#de4968', 7 "
    "'#f7705c', "
    "8 '#fe9f6d', 9 '#fecf92', 10 '#fcfdbf')";
constexpr const char* vik =
    "(0 '#001261', 1 '#022d71', 2 '#07477f', 3 '#246991', 4 '#5b93b0', 5 '#94b9cc', 6 '#ccdde5', 7 "
    "'#eee5df', "
    "8 '#e3c5b0', 9 '#d5a583', 10 '#c48256', 11 '#ae5c2b', 12 '#8b2f07', 13 '#6f1305', 14 '#590008')";

struct Solid {
  std::vector<double> positions;  // of the particles, as deformed
  double radius = 0;              // of the disc drawn for each
};

struct Outline {
  std::vector<double> deformed;   // x y x y of each segment
  std::vector<double> reference;  // the same before deformation
};

/// One panel: values at the nodes of the image and how they are shown.
struct Panel {
  std::vector<double> values;
  std::string label;
  double low = 0;
  double high = 1;
  bool clipped = false;
  const char* palette = viridis;
  std::vector<Streamline> lines = {};
};

/// Pixels of the whole picture and of one panel in it.
struct Layout {
  double panel_width = 0;
  double panel_height = 0;
  std::size_t columns = 1;
  std::size_t panels = 1;
  static constexpr double left = 145;
  static constexpr double right = 190;
  static constexpr double top = 30;
  static constexpr double bottom = 92;

  [[nodiscard]] std::size_t rows() const { return (panels + columns - 1) / columns; }
  [[nodiscard]] double width() const { return static_cast<double>(columns) * (left + panel_width + right); }
  [[nodiscard]] double height() const { return static_cast<double>(rows()) * (top + panel_height + bottom); }
};

Layout layout_of(const ImageFrame& image, std::size_t panels) {
  constexpr double widest = 1500;
  constexpr double highest = 1000;
  const double aspect = static_cast<double>(image.ny) / static_cast<double>(image.nx);
  Layout layout{.columns = aspect > 0.6 ? panels : 1, .panels = panels};
  const double room = layout.columns > 1 ? 0.5 * widest : widest;
  layout.panel_width = std::round(std::min(room, highest / aspect));
  layout.panel_height = std::round(std::max(40.0, layout.panel_width * aspect));
  return layout;
}

/// Low and high end of the colours: all values but the most extreme two in a thousand, which a corner may
/// hold.
void set_range(Panel& panel, bool may_be_signed) {
  std::vector<double> sorted;
  for (const double value : panel.values) {
    if (std::isfinite(value)) sorted.push_back(value);
  }
  if (sorted.empty())
    throw std::runtime_error(fmt::format("The last frame holds no finite {}.", panel.label));
  std::sort(sorted.begin(), sorted.end());
  const std::size_t cut = sorted.size() / 500;
  panel.low = sorted[cut];
  panel.high = sorted[sorted.size() - 1 - cut];
  panel.clipped = panel.low > sorted.front() || panel.high < sorted.back();
  if (may_be_signed && std::min(-panel.low, panel.high) > 0.1 * std::max(-panel.low, panel.high)) {
    panel.high = std::max(-panel.low, panel.high);
    panel.low = -panel.high;
    panel.palette = vik;
  }
  if (!(panel.high > panel.low)) {
    const double half = std::max(0.5 * std::abs(panel.high), 1e-12);
    panel.low -= half;
    panel.high += half;
  }
}

/// Bilinear from the nodes that hold a value. Where the nearest node holds none there is nothing, or, to
/// `fill`, what its neighbours hold: the solid drawn on top then meets colour, not the steps of the grid.
double sample(const ImageFrame& image, const std::vector<double>& values, double x, double y, bool fill) {
  const double i = std::clamp(x, 0.0, static_cast<double>(image.nx - 1));
  const double j = std::clamp(y, 0.0, static_cast<double>(image.ny - 1));
  const auto nearest =
      static_cast<std::size_t>(std::lround(j)) * image.nx + static_cast<std::size_t>(std::lround(i));
  if (!fill && !std::isfinite(values[nearest])) return no_value;
  const auto i0 = std::min(static_cast<std::size_t>(i), image.nx - 2);
  const auto j0 = std::min(static_cast<std::size_t>(j), image.ny - 2);
  const double fx = i - static_cast<double>(i0);
  const double fy = j - static_cast<double>(j0);
  double sum = 0;
  double weights = 0;
  for (const std::size_t dj : {std::size_t{0}, std::size_t{1}}) {
    for (const std::size_t di : {std::size_t{0}, std::size_t{1}}) {
      const double value = values[(j0 + dj) * image.nx + i0 + di];
      const double weight = (di == 1 ? fx : 1 - fx) * (dj == 1 ? fy : 1 - fy);
      if (!std::isfinite(value)) continue;
      sum += weight * value;
      weights += weight;
    }
  }
  return weights > 0 ? sum / weights : no_value;
}

/// The panel's pixels as a file of floats, row by row from below.
void write_raster(const std::filesystem::path& file, const ImageFrame& image, const Panel& panel,
                  const Layout& layout, bool fill) {
  const auto columns = static_cast<std::size_t>(layout.panel_width);
  const auto rows = static_cast<std::size_t>(layout.panel_height);
  std::vector<float> row(columns);
  std::ofstream stream(file, std::ios::binary);
  for (std::size_t r = 0; r < rows; ++r) {
    const double y =
        (static_cast<double>(r) + 0.5) / static_cast<double>(rows) * static_cast<double>(image.ny) - 0.5;
    for (std::size_t c = 0; c < columns; ++c) {
      const double x =
          (static_cast<double>(c) + 0.5) / static_cast<double>(columns) * static_cast<double>(image.nx) - 0.5;
      row[c] = static_cast<float>(sample(image, panel.values, x, y, fill));
    }
    stream.write(reinterpret_cast<const char*>(row.data()),
                 static_cast<std::streamsize>(columns * sizeof(float)));
  }
  stream.close();
  if (!stream) throw std::runtime_error(fmt::format("{}: cannot be written", file.string()));
}

std::optional<NamedFrame> frame_at(const std::filesystem::path& folder, const std::string& series,
                                   WhichFrame which) {
  return which == WhichFrame::first ? first_frame(folder, series) : last_frame(folder, series);
}

std::optional<Solid> read_solid(const std::filesystem::path& run_folder, WhichFrame which) {
  const auto last = frame_at(run_folder / "solid", "frame", which);
  if (!last) return std::nullopt;
  Solid solid{.positions = read_point_frame(last->file).positions};
  const std::size_t count = solid.positions.size() / 2;
  if (count < 2) return std::nullopt;
  // The distance to the nearest neighbour, from a few particles: the median is not misled by the border.
  std::vector<double> distances;
  const std::size_t stride = std::max<std::size_t>(1, count / 64);
  for (std::size_t i = 0; i < count; i += stride) {
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t j = 0; j < count; ++j) {
      if (i == j) continue;
      nearest = std::min(nearest, std::hypot(solid.positions[2 * i] - solid.positions[2 * j],
                                             solid.positions[2 * i + 1] - solid.positions[2 * j + 1]));
    }
    distances.push_back(nearest);
  }
  std::nth_element(distances.begin(), distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2),
                   distances.end());
  solid.radius = 0.75 * distances[distances.size() / 2];  // discs on a square grid then leave no gap
  return solid;
}

std::optional<Outline> read_outline(const std::filesystem::path& run_folder, WhichFrame which) {
  const auto last = frame_at(run_folder / "solid", "surface", which);
  if (!last) return std::nullopt;
  const auto frame = read_point_frame(last->file);
  const auto field = frame.fields.find("displacement");
  const bool known = field != frame.fields.end() && field->second.components >= 2;
  Outline outline;
  for (const std::size_t node : frame.segments) {
    for (std::size_t c = 0; c < 2; ++c) {
      const double position = frame.positions[2 * node + c];
      outline.deformed.push_back(position);
      if (known)
        outline.reference.push_back(position - field->second.values[node * field->second.components + c]);
    }
  }
  return outline;
}

/// Points "x y" as a named block of a script.
std::string point_block(const std::string& name, const std::vector<double>& points) {
  std::string text = fmt::format("${} << END\n", name);
  for (std::size_t i = 0; i + 1 < points.size(); i += 2)
    text += fmt::format("{:.9g} {:.9g}\n", points[i], points[i + 1]);
  return text + "END\n";
}

/// Segments as a named block of a script. One that begins where the one before ended goes on with its line:
/// dots would start anew in each otherwise.
std::string segment_block(const std::string& name, const std::vector<double>& segments) {
  std::string text = fmt::format("${} << END\n", name);
  for (std::size_t i = 0; i + 3 < segments.size(); i += 4) {
    const bool goes_on = i > 0 && segments[i] == segments[i - 2] && segments[i + 1] == segments[i - 1];
    if (!goes_on) text += fmt::format("\n{:.9g} {:.9g}\n", segments[i], segments[i + 1]);
    text += fmt::format("{:.9g} {:.9g}\n", segments[i + 2], segments[i + 3]);
  }
  return text + "END\n";
}

std::string streamline_blocks(const std::vector<Streamline>& lines) {
  std::string curves = "$streamlines << END\n";
  std::string arrows = "$arrows << END\n";
  for (const auto& line : lines) {
    const std::size_t count = line.points.size() / 2;
    constexpr std::size_t stride = 2;
    for (std::size_t i = 0; i < count; i += stride) {
      curves += fmt::format("{:.9g} {:.9g}\n", line.points[2 * i], line.points[2 * i + 1]);
    }
    curves += "\n";
    const std::size_t middle = count / 2;
    const std::size_t before = middle > 0 ? middle - 1 : 0;
    arrows += fmt::format("{:.9g} {:.9g} {:.9g} {:.9g}\n", line.points[2 * before],
                          line.points[2 * before + 1], line.points[2 * middle] - line.points[2 * before],
                          line.points[2 * middle + 1] - line.points[2 * before + 1]);
  }
  return curves + "END\n" + arrows + "END\n";
}

/// 1, 2 or 5 times a power of ten that divides `range` into three to six parts.
double tick_distance(double range) {
  const double rough = range / 3;
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  const double leading = rough / power;
  return power * (leading >= 5 ? 5 : leading >= 2 ? 2 : 1);
}

std::string panel_script(const Panel& panel, std::size_t number, const ImageFrame& image,
                         const Layout& layout, const std::filesystem::path& raster,
                         const std::optional<Solid>& solid, const std::optional<Outline>& outline) {
  const double h = image.spacing;
  const double width_m = h * static_cast<double>(image.nx);
  const double height_m = h * static_cast<double>(image.ny);
  const double x0 = image.x0 - 0.5 * h;
  const double y0 = image.y0 - 0.5 * h;
  const auto column = static_cast<double>(number % layout.columns);
  const auto row = static_cast<double>(number / layout.columns);
  const double left = column * (Layout::left + layout.panel_width + Layout::right) + Layout::left;
  const double top = row * (Layout::top + layout.panel_height + Layout::bottom) + Layout::top;
  const auto across = [&](double pixels) { return pixels / layout.width(); };
  const auto up = [&](double pixels) { return 1 - pixels / layout.height(); };

  std::string script = fmt::format(
      "set lmargin at screen {:.6f}\nset rmargin at screen {:.6f}\nset tmargin at screen {:.6f}\nset bmargin "
      "at screen {:.6f}\n",
      across(left), across(left + layout.panel_width), up(top), up(top + layout.panel_height));
  script +=
      fmt::format("set xrange [{:.9g}:{:.9g}]\nset yrange [{:.9g}:{:.9g}]\nset cbrange [{:.9g}:{:.9g}]\n", x0,
                  x0 + width_m, y0, y0 + height_m, panel.low, panel.high);
  // About one tick for every 90 pixels of height.
  script += fmt::format("set ytics autofreq\nset palette defined {}\n", panel.palette);
  if (layout.panel_height < 300) script += fmt::format("set ytics {:.3g}\n", height_m / 2);
  script += fmt::format("set colorbox user origin screen {:.6f},{:.6f} size screen {:.6f},{:.6f}\n",
                        across(left + layout.panel_width + 20), up(top + layout.panel_height), across(24),
                        layout.panel_height / layout.height());
  script += fmt::format("set cblabel {} offset 1,0\nset cbtics {:.3g}\n", Gnuplot::quoted(panel.label),
                        tick_distance(panel.high - panel.low));
  script += number + layout.columns < layout.panels ? "unset xlabel\n" : "set xlabel 'x [m]' offset 0,0.4\n";
  script += "set ylabel 'y [m]' offset 0,0\n";
  script += fmt::format(
      "plot {} binary array=({},{}) format='%float' origin=({:.9g},{:.9g}) dx={:.12g} dy={:.12g} using 1 "
      "with image notitle",
      Gnuplot::quoted(raster.string()), static_cast<int>(layout.panel_width),
      static_cast<int>(layout.panel_height), x0 + 0.5 * width_m / layout.panel_width,
      y0 + 0.5 * height_m / layout.panel_height, width_m / layout.panel_width,
      height_m / layout.panel_height);
  if (!panel.lines.empty()) {
    script +=
        ", $streamlines with lines lc rgb '#70ffffff' lw 1.6 notitle"
        ", $arrows with vectors head filled size screen 0.006,22 fixed lc rgb '#40ffffff' lw 1.6 notitle";
  }
  if (outline && !outline->reference.empty())
    script += fmt::format(", $reference with lines lc rgb '{}' lw 2 dt (7,5) notitle",
                          panel.palette == vik ? "#303030" : "#f4f4f4");
  if (solid) {
    script += fmt::format(
        ", $particles using 1:2:({:.9g}) with circles fs solid 1.0 noborder fc rgb '#e8e4dc' notitle",
        solid->radius);
  }
  if (outline) script += ", $surface with lines lc rgb '#101010' lw 3 notitle";
  return script + "\n";
}

}  // namespace

Picture draw_flow(const std::filesystem::path& run_folder, const std::filesystem::path& picture,
                  const std::filesystem::path& work_folder, bool steady, const Gnuplot& gnuplot,
                  WhichFrame which) {
  const auto last = frame_at(run_folder / "fluid", "frame", which);
  if (!last) throw std::runtime_error("The fluid left no frames, so there is no picture of the flow.");
  const auto image = read_image_frame(last->file);
  if (image.nx < 2 || image.ny < 2)
    throw std::runtime_error("The last frame of the fluid is too small for a picture.");

  const std::size_t nodes = image.nx * image.ny;
  std::vector<bool> blocked(nodes, false);
  if (const auto solid = image.fields.find("solid");
      solid != image.fields.end() && solid->second.components == 1) {
    for (std::size_t i = 0; i < nodes; ++i) blocked[i] = solid->second.values[i] > 0.5;
  }
  const auto shown = [&](auto&& value) {
    std::vector<double> values(nodes);
    for (std::size_t i = 0; i < nodes; ++i) values[i] = blocked[i] ? no_value : value(i);
    return values;
  };

  std::vector<Panel> panels;
  if (const auto field = image.fields.find("velocity");
      field != image.fields.end() && field->second.components >= 2) {
    const auto& [components, values] = field->second;
    Panel panel{.values = shown([&](std::size_t i) {
                  return std::hypot(values[i * components], values[i * components + 1]);
                }),
                .label = "speed [m/s]"};
    set_range(panel, false);
    panel.low = 0;
    constexpr double lines_across = 13;
    const double shorter = image.spacing * static_cast<double>(std::min(image.nx, image.ny));
    panel.lines = streamlines(image, blocked, std::max(shorter / lines_across, 2 * image.spacing));
    panels.push_back(std::move(panel));
  }
  if (const auto field = image.fields.find("pressure");
      field != image.fields.end() && field->second.components == 1) {
    Panel panel{.values = shown([&](std::size_t i) { return field->second.values[i]; }),
                .label = "pressure [Pa]",
                .palette = magma};
    set_range(panel, true);
    panels.push_back(std::move(panel));
  }
  if (panels.empty())
    throw std::runtime_error("The last frame of the fluid holds neither velocity nor pressure.");

  const auto solid = read_solid(run_folder, which);
  const auto outline = read_outline(run_folder, which);
  const Layout layout = layout_of(image, panels.size());
  std::string script =
      "set multiplot\nset border lw 1.5 lc rgb '#404040'\nset tics out nomirror scale 0.6\nset xtics offset "
      "0,0.2\n"
      "set object 1 rectangle from graph 0,0 to graph 1,1 fc rgb '#b8b4ac' fs solid noborder behind\nunset "
      "key\n";
  if (solid) script += point_block("particles", solid->positions);
  if (outline) {
    script += segment_block("surface", outline->deformed);
    if (!outline->reference.empty()) script += segment_block("reference", outline->reference);
  }
  for (std::size_t p = 0; p < panels.size(); ++p) {
    const auto raster = work_folder / fmt::format("panel-{}.raw", p);
    write_raster(raster, image, panels[p], layout, solid.has_value());
    if (!panels[p].lines.empty()) script += streamline_blocks(panels[p].lines);
    script += panel_script(panels[p], p, image, layout, raster, solid, outline);
  }
  script += "unset multiplot\n";
  gnuplot.draw(picture,
               fmt::format("pngcairo size {:.0f},{:.0f} font 'Sans,19' background rgb 'white'",
                           layout.width(), layout.height()),
               script);

  std::string caption = fmt::format(
      "The flow in the {} frame ({}, {}).", which == WhichFrame::first ? "first" : "last",
      last->file.filename().string(),
      steady ? fmt::format("iteration {:.6g}", last->time) : fmt::format("t = {:.6g} s", last->time));
  if (!panels.front().lines.empty()) caption += " White lines are streamlines.";
  if (outline) caption += " The black line is the wet surface";
  if (outline && !outline->reference.empty()) caption += ", the dashed one its place before deformation";
  if (outline) caption += ".";
  if (std::any_of(panels.begin(), panels.end(), [](const Panel& panel) { return panel.clipped; })) {
    caption += " The colours leave out the two most extreme values in a thousand at each end.";
  }
  return {.file = picture, .caption = caption};
}

}  // namespace estuary::coupler
