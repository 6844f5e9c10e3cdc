#include "streamlines.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace estuary::coupler {
namespace {

using Vector = std::array<double, 2>;

class Tracer {
public:
  Tracer(const ImageFrame& image, const FrameField& velocity, const std::vector<bool>& blocked,
         double separation)
      : image_(image),
        velocity_(velocity),
        blocked_(blocked),
        separation_(separation),
        columns_(cells(image.nx)),
        rows_(cells(image.ny)),
        owner_(columns_ * rows_, nobody) {
    for (std::size_t i = 0; i < image.nx * image.ny; ++i) {
      if (!blocked[i]) fastest_ = std::max(fastest_, std::hypot(component(i, 0), component(i, 1)));
    }
  }

  [[nodiscard]] std::vector<Streamline> trace_all() {
    std::vector<Streamline> lines;
    if (!(fastest_ > 0) || !std::isfinite(fastest_)) return lines;
    // Columns from the left, because most pictures show flow from there: its lines then run through.
    for (std::size_t i = 0; i < columns_; ++i) {
      for (std::size_t j = 0; j < rows_; ++j) {
        if (owner_[j * columns_ + i] != nobody) continue;
        const Vector seed{image_.x0 + (static_cast<double>(i) + 0.5) * separation_,
                          image_.y0 + (static_cast<double>(j) + 0.5) * separation_};
        auto line = trace(seed, lines.size());
        if (line.points.size() >= 2 * 20) lines.push_back(std::move(line));
      }
    }
    return lines;
  }

private:
  static constexpr std::size_t nobody = static_cast<std::size_t>(-1);

  [[nodiscard]] std::size_t cells(std::size_t points) const {
    const double length = static_cast<double>(points - 1) * image_.spacing;
    return std::max<std::size_t>(1, static_cast<std::size_t>(length / separation_));
  }
  [[nodiscard]] double component(std::size_t point, std::size_t c) const {
    return velocity_.values[point * velocity_.components + c];
  }

  /// Bilinear; nothing outside and next to what is blocked.
  [[nodiscard]] std::optional<Vector> velocity_at(const Vector& at) const {
    const double x = (at[0] - image_.x0) / image_.spacing;
    const double y = (at[1] - image_.y0) / image_.spacing;
    if (!(x >= 0 && y >= 0 && x < static_cast<double>(image_.nx - 1) &&
          y < static_cast<double>(image_.ny - 1))) {
      return std::nullopt;
    }
    const auto i = static_cast<std::size_t>(x);
    const auto j = static_cast<std::size_t>(y);
    const double fx = x - static_cast<double>(i);
    const double fy = y - static_cast<double>(j);
    const std::size_t corner = j * image_.nx + i;
    Vector result{};
    for (const auto& [offset, weight] :
         {std::pair{corner, (1 - fx) * (1 - fy)}, std::pair{corner + 1, fx * (1 - fy)},
          std::pair{corner + image_.nx, (1 - fx) * fy}, std::pair{corner + image_.nx + 1, fx * fy}}) {
      if (blocked_[offset]) return std::nullopt;
      for (std::size_t c = 0; c < 2; ++c) result[c] += weight * component(offset, c);
    }
    if (!(std::hypot(result[0], result[1]) > 1e-3 * fastest_)) return std::nullopt;
    return result;
  }

  [[nodiscard]] std::size_t cell_of(const Vector& at) const {
    const auto index = [&](double distance, std::size_t count) {
      return std::min(count - 1, static_cast<std::size_t>(std::max(0.0, distance / separation_)));
    };
    return index(at[1] - image_.y0, rows_) * columns_ + index(at[0] - image_.x0, columns_);
  }

  /// One direction from `at`: points after it, and the cells they lie in.
  void follow(Vector at, double sign, std::size_t line, std::vector<double>& points,
              std::vector<std::size_t>& visited) {
    const double step = 0.5 * image_.spacing;
    const std::size_t most_steps = 8 * (image_.nx + image_.ny);
    std::size_t cell = cell_of(at);
    for (std::size_t k = 0; k < most_steps; ++k) {
      const auto here = velocity_at(at);
      if (!here) return;
      const auto toward = [&](const Vector& from, const Vector& velocity, double length) {
        const double speed = std::hypot(velocity[0], velocity[1]);
        return Vector{from[0] + sign * length * velocity[0] / speed,
                      from[1] + sign * length * velocity[1] / speed};
      };
      const auto middle = velocity_at(toward(at, *here, 0.5 * step));
      if (!middle) return;
      at = toward(at, *middle, step);
      const std::size_t next = cell_of(at);
      if (next != cell) {
        // A cell of another line, or one this line has left before: a closed curve has come round.
        if (owner_[next] != nobody) return;
        owner_[next] = line;
        visited.push_back(next);
        cell = next;
      }
      points.insert(points.end(), at.begin(), at.end());
    }
  }

  Streamline trace(const Vector& seed, std::size_t line) {
    std::vector<std::size_t> visited{cell_of(seed)};
    owner_[visited.front()] = line;
    std::vector<double> forward;
    std::vector<double> backward;
    follow(seed, 1.0, line, forward, visited);
    follow(seed, -1.0, line, backward, visited);
    Streamline result;
    for (std::size_t k = backward.size(); k >= 2; k -= 2) {
      result.points.insert(result.points.end(), {backward[k - 2], backward[k - 1]});
    }
    result.points.insert(result.points.end(), seed.begin(), seed.end());
    result.points.insert(result.points.end(), forward.begin(), forward.end());
    // A line too short to be shown does not keep others away.
    if (result.points.size() < 2 * 20) {
      for (const std::size_t cell : visited) owner_[cell] = nobody;
    }
    return result;
  }

  const ImageFrame& image_;
  const FrameField& velocity_;
  const std::vector<bool>& blocked_;
  double separation_;
  std::size_t columns_;
  std::size_t rows_;
  std::vector<std::size_t> owner_;
  double fastest_ = 0;
};

}  // namespace

std::vector<Streamline> streamlines(const ImageFrame& image, const std::vector<bool>& blocked,
                                    double separation) {
  const auto velocity = image.fields.find("velocity");
  if (velocity == image.fields.end() || velocity->second.components < 2 || image.nx < 2 || image.ny < 2)
    return {};
  return Tracer(image, velocity->second, blocked, separation).trace_all();
}

}  // namespace estuary::coupler
