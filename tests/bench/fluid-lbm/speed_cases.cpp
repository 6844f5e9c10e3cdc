#include "speed_cases.hpp"

#include <cmath>
#include <numbers>

namespace estuary::fluid::speed {
namespace {

constexpr double lid = 0.05;

// A disc in the channel, as a wet surface.
struct Body {
  static constexpr std::uint32_t count = 200;
  std::vector<double> points;
  std::vector<double> velocities;
  std::vector<std::uint32_t> connectivity;
  explicit Body(double speed) {
    for (std::uint32_t n = 0; n < count; ++n) {
      const double angle = -2 * std::numbers::pi * n / count;
      points.insert(points.end(), {300.3 + 25.2 * std::cos(angle), 100.2 + 25.2 * std::sin(angle)});
      velocities.insert(velocities.end(), {speed, 0.0});
      connectivity.insert(connectivity.end(), {n, (n + 1) % count});
    }
  }
};

struct WithBody : Case {
  WithBody(const FlowSettings& settings, double speed) : Case(settings), body(speed), step(speed) {
    flow.set_wet_surface(Body::count, body.connectivity);
    flow.move_wet_surface(body.points, body.velocities, 1.0);
  }
  void run(int steps) override {
    if (step == 0) {
      Case::run(steps);
      return;
    }
    // Geometry, links and nodes left behind in every step.
    for (int n = 0; n < steps; ++n) {
      flow.run(1);
      if (body.points.front() > 600 || body.points.front() < 300) step = -step;
      for (std::uint32_t k = 0; k < Body::count; ++k) {
        body.points[2 * k] += step;
        body.velocities[2 * k] = step;
      }
      flow.move_wet_surface(body.points, body.velocities, 1.0);
    }
  }
  Body body;
  double step;
};

// The same channel with nothing of `Flow` but its two open sides, its walls and its variant of the step.
struct Bare : Case {
  explicit Bare(const FlowSettings& settings) : Case(settings) {}
  void run(int steps) override {
    const FlowSettings& s = flow.settings();
    const CollideAndStream step = collide_and_stream(s.step());
    const CollisionParameters parameters{s.rates, s.acceleration, s.magic_parameter, s.law, nullptr};
    Populations& populations = flow.populations();
    Sides& sides = flow.sides();
    const Parity start = populations.parity();
    const Parity other = start == Parity::even ? Parity::odd : Parity::even;
#pragma omp parallel
    for (int n = 0; n < steps; ++n) {
      const Parity parity = n % 2 == 0 ? start : other;
      exchange_and_reflect(populations, parity, sides);
      complete_open_sides(populations, parity, flow.cells(), sides, s.equilibrium, {}, false);
      step(populations, parity, {flow.cells().rows()}, parameters);
    }
    populations.set_parity(steps % 2 == 0 ? start : other);
  }
};

struct Porous : Case {
  Porous(const FlowSettings& settings, int radius, double solid) : Case(settings) {
    flow.set_solid_nodes(packing(flow.grid(), radius, solid));
  }
};

FlowSettings single(FlowSettings settings) {
  settings.storage = Storage::single_precision;
  return settings;
}

FlowSettings with_option(ForceModel force, ViscosityModel viscosity) {
  FlowSettings settings = channel(1000, 200);
  settings.force = force;
  settings.viscosity = viscosity;
  settings.law.base_viscosity = 0.02;
  settings.law.smagorinsky_constant = 0.1;
  settings.law.consistency = 0.02;
  settings.law.index = 0.7;
  settings.law.largest = 1;
  return settings;
}

FlowSettings with_operator(CollisionModel collision, EquilibriumModel equilibrium) {
  FlowSettings settings = channel(1000, 200);
  settings.collision = collision;
  settings.equilibrium = equilibrium;
  return settings;
}

}  // namespace

FlowSettings cavity(int nx, int ny, int nz) {
  FlowSettings settings;
  settings.grid.nx = nx;
  settings.grid.ny = ny;
  settings.grid.nz = nz;
  settings.rates = relaxation_rates(0.02, 3.0 / 16.0);
  const auto points =
      static_cast<std::size_t>(2 * nx + 1) * static_cast<std::size_t>(nz > 0 ? 2 * nz + 1 : 1);
  Side& side = settings.sides[top];
  side.velocity_x.assign(points, lid);
  side.velocity_y.assign(points, 0.0);
  if (nz > 0) side.velocity_z.assign(points, 0.0);
  return settings;
}

FlowSettings channel(int nx, int ny) {
  FlowSettings settings;
  settings.grid.nx = nx;
  settings.grid.ny = ny;
  settings.rates = relaxation_rates(0.02, 3.0 / 16.0);
  const auto nodes = static_cast<std::size_t>(ny);
  Side& inlet = settings.sides[left];
  inlet.kind = SideKind::velocity;
  for (int y = 0; y < ny; ++y) {
    const double height = (y + 0.5) / ny;
    inlet.velocity_x.push_back(4 * lid * height * (1 - height));
  }
  inlet.velocity_y.assign(nodes, 0.0);
  Side& outlet = settings.sides[right];
  outlet.kind = SideKind::pressure;
  outlet.excess.assign(nodes, 0.0);
  return settings;
}

std::vector<std::uint16_t> packing(const Grid& grid, int radius, double share) {
  std::vector<std::uint16_t> solid(grid.size(), 0);
  std::uint64_t seed = 1;
  const auto place = [&seed](int count) {
    seed = seed * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<int>((seed >> 33) % static_cast<std::uint64_t>(count));
  };
  const auto wanted = static_cast<std::size_t>(share * static_cast<double>(solid.size()));
  const bool space = grid.nz > 0;
  std::size_t covered = 0;
  while (covered < wanted) {
    const int x0 = place(grid.nx);
    const int y0 = place(grid.ny);
    const int z0 = space ? place(grid.nz) : 0;
    for (int z = space ? std::max(0, z0 - radius) : 0; z <= (space ? std::min(grid.nz - 1, z0 + radius) : 0);
         ++z) {
      for (int y = std::max(0, y0 - radius); y <= std::min(grid.ny - 1, y0 + radius); ++y) {
        for (int x = std::max(0, x0 - radius); x <= std::min(grid.nx - 1, x0 + radius); ++x) {
          const int square = (x - x0) * (x - x0) + (y - y0) * (y - y0) + (z - z0) * (z - z0);
          std::uint16_t& node = solid[grid.index(x, y, z)];
          if (square > radius * radius || node != 0) continue;
          node = 1;
          ++covered;
        }
      }
    }
  }
  return solid;
}

std::vector<std::pair<std::string, std::function<std::shared_ptr<Case>()>>> cases() {
  const auto plain = [](auto make) {
    return [make]() -> std::shared_ptr<Case> { return std::make_shared<Case>(make()); };
  };
  const auto option = [](ForceModel force, ViscosityModel viscosity) {
    return [=]() -> std::shared_ptr<Case> { return std::make_shared<Case>(with_option(force, viscosity)); };
  };
  const auto collision = [](CollisionModel model, EquilibriumModel equilibrium) {
    return
        [=]() -> std::shared_ptr<Case> { return std::make_shared<Case>(with_operator(model, equilibrium)); };
  };
  return {
      {"cavity 1000 x 1000", plain([] { return cavity(1000, 1000); })},
      {"cavity 1000 x 1000, single precision", plain([] { return single(cavity(1000, 1000)); })},
      {"channel 1000 x 1000", plain([] { return channel(1000, 1000); })},
      {"porous 1000 x 1000, discs of radius 12",
       [] { return std::make_shared<Porous>(channel(1000, 1000), 12, 0.6); }},
      {"porous 1000 x 1000, discs of radius 4",
       [] { return std::make_shared<Porous>(channel(1000, 1000), 4, 0.6); }},
      {"porous 300 x 300, in cache, discs of radius 12",
       [] { return std::make_shared<Porous>(channel(300, 300), 12, 0.6); }},
      {"channel 300 x 300, in cache", plain([] { return channel(300, 300); })},
      {"channel 1000 x 200", plain([] { return channel(1000, 200); })},
      {"channel 1000 x 200, single precision", plain([] { return single(channel(1000, 200)); })},
      {"channel 1000 x 200, body at rest",
       [] { return std::make_shared<WithBody>(channel(1000, 200), 0.0); }},
      {"channel 1000 x 200, moving body",
       [] { return std::make_shared<WithBody>(channel(1000, 200), 0.02); }},
      {"channel 1000 x 200, no rules but its own", [] { return std::make_shared<Bare>(channel(1000, 200)); }},
      {"channel, body force", option(ForceModel::guo, ViscosityModel::constant)},
      {"channel, Smagorinsky", option(ForceModel::none, ViscosityModel::smagorinsky)},
      {"channel, power law", option(ForceModel::none, ViscosityModel::generalised_newtonian)},
      {"channel, BGK", collision(CollisionModel::bgk, EquilibriumModel::incompressible)},
      {"channel, recursive regularised",
       collision(CollisionModel::recursive_regularised, EquilibriumModel::compressible)},
      {"channel, central moments", collision(CollisionModel::central_moment, EquilibriumModel::compressible)},
      {"D3Q19 cavity 128^3", plain([] { return cavity(128, 128, 128); })},
      {"D3Q19 cavity 128^3, single precision", plain([] { return single(cavity(128, 128, 128)); })},
      {"D3Q19 porous 128^3, spheres of radius 12",
       [] { return std::make_shared<Porous>(cavity(128, 128, 128), 12, 0.6); }},
      {"D3Q19 cavity 40^3, in cache", plain([] { return cavity(40, 40, 40); })},
  };
}

std::vector<Ratio> ratios() {
  return {
      {"cavity 1000 x 1000, single precision", "cavity 1000 x 1000",
       "single over double precision, cavity from memory"},
      {"channel 1000 x 200, single precision", "channel 1000 x 200",
       "single over double precision, channel in cache"},
      {"D3Q19 cavity 128^3, single precision", "D3Q19 cavity 128^3", "single over double precision, D3Q19"},
      {"porous 1000 x 1000, discs of radius 12", "channel 1000 x 1000",
       "a fluid node among discs over one of the open channel"},
      {"porous 300 x 300, in cache, discs of radius 12", "channel 300 x 300, in cache", "the same, in cache"},
      {"porous 1000 x 1000, discs of radius 4", "channel 1000 x 1000", "the same, discs of radius 4"},
      {"D3Q19 porous 128^3, spheres of radius 12", "D3Q19 cavity 128^3", "the same in space"},
      {"channel 1000 x 200", "channel 1000 x 200, no rules but its own",
       "every option off over a loop that has none (1: off costs nothing)"},
      {"channel, body force", "channel 1000 x 200", "a body force switched on"},
      {"channel, Smagorinsky", "channel 1000 x 200", "Smagorinsky switched on"},
      {"channel 1000 x 200, moving body", "channel 1000 x 200", "a body that moves in every step"},
  };
}

}  // namespace estuary::fluid::speed
