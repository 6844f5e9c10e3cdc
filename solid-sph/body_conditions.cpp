#include "body_conditions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "rigid_motion.hpp"
#include "shell_row.hpp"
#include "surface_transfer.hpp"

#include "shell_row.hpp"

namespace estuary::solid {
namespace {

class Selection {
public:
  Selection(const SolidScene& scene, const Body& body, const Place& place)
      : body_(body), place_(place), slip_(1e-6 * scene.spacing) {
    if (!place.side) return;
    const Box& box = scene.bodies[place.body].box;
    const double x0 = box.from[0], x1 = box.to[0], y0 = box.from[1], y1 = box.to[1];
    switch (*place.side) {
      case Side::left:
        place_.stretch = {x0, y0, x0, y1};
        break;
      case Side::right:
        place_.stretch = {x1, y0, x1, y1};
        break;
      case Side::top:
        place_.stretch = {x0, y1, x1, y1};
        break;
      case Side::bottom:
        place_.stretch = {x0, y0, x1, y0};
        break;
    }
  }
  [[nodiscard]] bool holds(std::size_t i) const {
    if ((!place_.every_body && body_.member[i] != place_.body) || i >= body_.particles()) return false;
    const double x = body_.position[2 * i], y = body_.position[2 * i + 1];
    if (place_.stretch) {
      const auto [x0, y0, x1, y1] = *place_.stretch;
      const double length = std::hypot(x1 - x0, y1 - y0);
      const double along = ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / length;
      const double across = ((x - x0) * (y1 - y0) - (y - y0) * (x1 - x0)) / length;
      return std::abs(across) <= slip_ && along >= -slip_ && along <= length + slip_;
    }
    if (place_.region) {
      const auto [x0, y0, x1, y1] = *place_.region;
      return x >= x0 - slip_ && x <= x1 + slip_ && y >= y0 - slip_ && y <= y1 + slip_;
    }
    return true;
  }
  /// Segments of the body's contours both of whose ends are selected.
  [[nodiscard]] std::vector<std::array<std::uint32_t, 2>> segments() const {
    std::vector<std::array<std::uint32_t, 2>> result;
    for (std::size_t o = 0; o < body_.outlines.size(); ++o) {
      if (body_.outline_member[o] != place_.body) continue;
      const auto& particle = body_.outlines[o].particle;
      for (std::size_t k = 0; k + (body_.outlines[o].closed ? 0 : 1) < particle.size(); ++k) {
        const std::uint32_t a = particle[k], b = particle[(k + 1) % particle.size()];
        if (holds(a) && holds(b)) result.push_back({a, b});
      }
    }
    return result;
  }

  /// Where the nearest particle would have been, for a message.
  [[nodiscard]] std::string nearest() const {
    if (!place_.stretch && !place_.region) return "";
    const auto [x0, y0, x1, y1] = place_.stretch ? *place_.stretch : *place_.region;
    double best = 1e300, x = 0, y = 0;
    for (std::size_t i = 0; i < body_.particles(); ++i) {
      if (!place_.every_body && body_.member[i] != place_.body) continue;
      const double px = body_.position[2 * i], py = body_.position[2 * i + 1];
      double nx = std::clamp(px, std::min(x0, x1), std::max(x0, x1)),
             ny = std::clamp(py, std::min(y0, y1), std::max(y0, y1));
      if (place_.stretch) {
        const double squared = (x1 - x0) * (x1 - x0) + (y1 - y0) * (y1 - y0);
        const double s = std::clamp(((px - x0) * (x1 - x0) + (py - y0) * (y1 - y0)) / squared, 0.0, 1.0);
        nx = x0 + s * (x1 - x0);
        ny = y0 + s * (y1 - y0);
      }
      const double distance = std::hypot(px - nx, py - ny);
      if (distance < best) {
        best = distance;
        x = px;
        y = py;
      }
    }
    return fmt::format(
        "; the nearest particle is at ({:.6g}, {:.6g}) m, {:.2g} m away: move it there, or choose a "
        "spacing that places one here",
        x, y, best);
  }

private:
  const Body& body_;
  Place place_;
  double slip_;
};

// Reference length of the contour each particle stands for.
void share_lengths(const Body& body, const std::vector<std::array<std::uint32_t, 2>>& segments,
                   std::vector<std::uint32_t>& particles, std::vector<double>& lengths) {
  for (const auto& [a, b] : segments) {
    const double length = std::hypot(body.position[2 * b] - body.position[2 * a],
                                     body.position[2 * b + 1] - body.position[2 * a + 1]);
    for (const std::uint32_t end : {a, b}) {
      const auto found = std::find(particles.begin(), particles.end(), end);
      if (found != particles.end()) {
        lengths[static_cast<std::size_t>(found - particles.begin())] += 0.5 * length;
      } else {
        particles.push_back(end);
        lengths.push_back(0.5 * length);
      }
    }
  }
}

std::vector<std::uint32_t> particles_of(const Body& body, const Selection& selection) {
  std::vector<std::uint32_t> chosen;
  for (std::uint32_t i = 0; i < body.size(); ++i)
    if (selection.holds(i)) chosen.push_back(i);
  return chosen;
}

void check_conditions(const SolidScene& scene, const Body& body) {
  std::vector<UnmetCondition> unmet;
  for (std::size_t h = 0; h < scene.holds.size(); ++h) {
    const Selection selection(scene, body, scene.holds[h].place);
    if (particles_of(body, selection).empty())
      unmet.push_back({"hold", h, "meets no particle" + selection.nearest()});
  }
  for (std::size_t l = 0; l < scene.loads.size(); ++l) {
    const Place& place = scene.loads[l].place;
    if (body.outlines.empty() && place.side) continue;
    const Selection selection(scene, body, place);
    if (!selection.segments().empty()) continue;
    const bool of_shell = scene.bodies[place.body].shell.has_value();
    if (!of_shell && !scene.loads[l].on_particles())
      unmet.push_back({"load", l, "meets no segment of a contour" + selection.nearest()});
    else if (particles_of(body, selection).empty())
      unmet.push_back(
          {"load", l,
           (of_shell ? "meets no particle of the shell" : "meets no particle") + selection.nearest()});
  }
  if (!unmet.empty()) throw UnmetConditions(std::move(unmet));
}

std::string all_of(const std::vector<UnmetCondition>& conditions) {
  std::string text;
  for (const auto& [table, number, message] : conditions)
    text += fmt::format("{}[[solid.{}]] number {} {}", text.empty() ? "" : "; ", table, number + 1, message);
  return text;
}

}  // namespace

UnmetConditions::UnmetConditions(std::vector<UnmetCondition> found)
    : std::invalid_argument(all_of(found)), conditions(std::move(found)) {}

void mark_held(const SolidScene& scene, Body& body) {
  for (const HoldScene& hold : scene.holds) {
    const Selection selection(scene, body, hold.place);
    for (std::size_t i = 0; i < body.size(); ++i)
      if (selection.holds(i)) {
        for (std::size_t c = 0; c < 2; ++c)
          if (hold.component[c]) body.fixed[i] = static_cast<std::uint8_t>(body.fixed[i] | (c == 0 ? 1 : 2));
        if (hold.rotation && scene.bodies[hold.place.body].shell)
          body.fixed[i] = static_cast<std::uint8_t>(body.fixed[i] | kRotationFixed);
      }
  }
}

std::vector<std::uint32_t> held_particles(const SolidScene& scene, const Body& body, std::size_t hold) {
  return particles_of(body, Selection(scene, body, scene.holds[hold].place));
}

void set_velocities(const SolidScene& scene, const Body& body, State& state) {
  for (std::size_t r = 0; r < body.rigid.size(); ++r) {
    const RigidBody& rigid = body.rigid[r];
    const BodyScene& described = scene.bodies[rigid.member];
    const std::span<double> values = std::span<double>(state.rigid).subspan(6 * r, 6);
    for (std::size_t c = 0; c < 3; ++c) {
      if (!described.rigid->motion[c].empty()) values[c] = Expression(described.rigid->motion[c])(0, 0, 0, 0);
      if (rigid.held[c]) continue;
      if (c == 2)
        values[5] = described.rigid->angular_velocity;
      else if (!described.velocity[c].empty())
        values[3 + c] = Expression(described.velocity[c])(rigid.centre[0], rigid.centre[1], 0, 0);
    }
    carry(rigid, body, values, state.displacement, state.velocity);
  }
  for (std::size_t k = 0; k < scene.bodies.size(); ++k)
    for (std::size_t c = 0; c < 2; ++c) {
      if (scene.bodies[k].velocity[c].empty()) continue;
      const Expression velocity(scene.bodies[k].velocity[c]);
      for (std::size_t i = 0; i < body.size(); ++i)
        if (body.member[i] == k && !body.holds(i, c) && !scene.held[c])
          state.velocity[2 * i + c] = velocity(body.position[2 * i], body.position[2 * i + 1], 0, 0);
    }
}

Loading build_loading(const SolidScene& scene, const Body& body,
                      std::vector<std::unique_ptr<Expression>>& expressions) {
  check_conditions(scene, body);
  Loading loading;
  loading.gravity = scene.gravity;
  loading.held = scene.held;
  const auto keep = [&](const std::string& text) {
    expressions.push_back(std::make_unique<Expression>(text.empty() ? "0" : text));
    return expressions.back().get();
  };
  if (scene.contact && !scene.impact()) {
    for (std::size_t k = 0; k < scene.bodies.size(); ++k)
      loading.contact.modulus.push_back(
          scene.bodies[k].rigid ? 0.0 : scene.contact_stiffness * scene.constants(k).wave_modulus());
    loading.contact.rigid_modulus = scene.contact_modulus;
  }
  for (const HoldScene& hold : scene.holds)
    for (std::size_t c = 0; c < 2; ++c) {
      if (!hold.component[c] || hold.displacement[c].empty()) continue;
      const Selection selection(scene, body, hold.place);
      PrescribedMotion motion;
      motion.component = c;
      for (std::size_t i = 0; i < body.size(); ++i)
        if (selection.holds(i)) motion.particle.push_back(static_cast<std::uint32_t>(i));
      motion.displacement = [e = keep(hold.displacement[c])](double x, double y, double t) {
        return (*e)(x, y, 0, t);
      };
      loading.prescribed.push_back(std::move(motion));
    }
  for (std::size_t r = 0; r < body.rigid.size(); ++r)
    for (std::size_t c = 0; c < 3; ++c) {
      const std::string& motion = scene.bodies[body.rigid[r].member].rigid->motion[c];
      if (motion.empty()) continue;
      loading.rigid_drives.push_back({r, c, [e = keep(motion)](double t) { return (*e)(0, 0, 0, t); }});
    }
  for (const LoadScene& scene_load : scene.loads) {
    const auto scaled_by_ramp = [&](ParticleLoad& load) {
      if (!scene_load.ramp.empty())
        load.factor = [e = keep(scene_load.ramp)](double t) { return (*e)(0, 0, 0, t); };
    };
    if (body.outlines.empty() && scene_load.place.side) {
      const ContourLine line = contour_line(body, {&*scene_load.place.side, 1});
      const Transfer transfer = contour_transfer(body, {&line, 1});
      ParticleLoad load;
      load.particle = transfer.touched;
      spread(transfer, uniform_traction(line, scene_load.force[0], scene_load.force[1]), load.end);
      load.start = load.end;
      scaled_by_ramp(load);
      loading.loads.push_back(std::move(load));
      continue;
    }
    const Selection selection(scene, body, scene_load.place);
    const auto segments = selection.segments();
    // A load on single particles: of a shell in equal shares, of other bodies by their volumes.
    const bool of_shell = scene.bodies[scene_load.place.body].shell.has_value();
    if (of_shell ? segments.empty() || scene_load.moment != 0 : segments.empty()) {
      const std::vector<std::uint32_t> chosen = particles_of(body, selection);
      ParticleLoad load;
      load.particle = chosen;
      double total = 0;
      for (const std::uint32_t i : chosen) total += of_shell ? 1 : body.volume[i];
      for (const std::uint32_t i : chosen)
        for (const double force : scene_load.force)
          load.end.push_back(force * (of_shell ? 1 : body.volume[i]) / total);
      load.start = load.end;
      scaled_by_ramp(load);
      if (scene_load.moment != 0)
        loading.moments.push_back({chosen, scene_load.moment, load.factor});
      else
        loading.loads.push_back(std::move(load));
      continue;
    }
    if (!scene_load.pressure.empty()) {
      PressureLoad load;
      load.segment = segments;
      load.pressure = [e = keep(scene_load.pressure)](double x, double y, double t) {
        return (*e)(x, y, 0, t);
      };
      loading.pressures.push_back(std::move(load));
      continue;
    }
    if (!scene_load.traction[0].empty() || !scene_load.traction[1].empty()) {
      TractionLoad load;
      load.segment = segments;
      load.traction = [ex = keep(scene_load.traction[0]), ey = keep(scene_load.traction[1])](
                          double x, double y, double t) {
        return std::array<double, 2>{(*ex)(x, y, 0, t), (*ey)(x, y, 0, t)};
      };
      loading.tractions.push_back(std::move(load));
      continue;
    }
    std::vector<std::uint32_t> particles;
    std::vector<double> lengths;
    share_lengths(body, segments, particles, lengths);
    double total = 0;
    for (const double length : lengths) total += length;
    ParticleLoad load;
    load.particle = particles;
    for (const double length : lengths)
      for (std::size_t c = 0; c < 2; ++c) load.end.push_back(scene_load.force[c] * length / total);
    load.start = load.end;
    scaled_by_ramp(load);
    loading.loads.push_back(std::move(load));
  }
  return loading;
}

}  // namespace estuary::solid
