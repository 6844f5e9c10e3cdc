// Limits of stability by bisection, with the symptom seen beyond each: one line of CSV per limit on standard
// output.
//
//     solid_sph_limits [part of a name]
#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "newton.hpp"
#include "scene.hpp"
#include "solid_scene.hpp"

namespace {

using namespace estuary::solid;

struct Block {
  Body body;
  std::unique_ptr<Solver> solver;
  double wave_speed = 0;

  struct Options {
    LawName law = LawName::saint_venant_kirchhoff;
    double young = 1e6, poisson = 0.3, density = 1000;
    double length = 1, height = 1;
    int across = 10;
    double viscosity = 0, stabilisation = 0.02;
    Kernel kernel = Kernel::cubic_spline;
    double smoothing_ratio = 0.95;
    bool left = false, right = false, slide = false;
    bool confined = false;  // ends slide, sides keep their height
    bool guided = false;    // ends slide, sides stay straight at the height that no force on them asks for
    Plane plane = Plane::strain;
  };
  explicit Block(const Options& o) {
    Box box;
    box.to = {o.length, o.height};
    box.spacing = o.height / o.across;
    box.clamped = {o.left, false, o.right, false};
    box.even = o.plane == Plane::strain && o.poisson > 0.45;  // as scenes are filled
    body = fill(box, o.density, o.smoothing_ratio, false);
    if (o.slide)
      for (std::size_t i = 0; i < body.size(); ++i)
        if (body.position[2 * i] < 1e-9) body.fixed[i] = 1;
    if (o.confined || o.guided)
      for (std::size_t i = 0; i < body.size(); ++i) {
        const double x = body.position[2 * i], y = body.position[2 * i + 1];
        const unsigned along = x < 1e-9 || x > o.length - 1e-9 ? 1 : 0;
        const unsigned across = y < 1e-9 || y > o.height - 1e-9 ? 2 : 0;
        body.fixed[i] = static_cast<std::uint8_t>(along | across);
      }
    Material material{.constants = ElasticConstants::from(o.young, o.poisson, o.plane),
                      .plane = o.plane,
                      .viscosity = {},
                      .plasticity = {}};
    material.plasticity.strain = {0, 1};
    material.plasticity.yield = {1e3 * o.young, 1e3 * o.young};
    wave_speed = std::sqrt(material.constants.wave_modulus() / o.density);
    material.viscosity = {.linear = o.viscosity,
                          .quadratic = 2 * o.viscosity,
                          .sound_speed = wave_speed,
                          .smoothing_length = body.smoothing_length,
                          .density = o.density};
    SolverOptions options;
    options.materials.push_back(material);
    options.stabilisation = o.stabilisation;
    options.kernel = o.kernel;
    solver = make_solver(o.law, body, options);
  }
};

struct Verdict {
  bool holds = false;
  std::string symptom;
};
using Trial = std::function<Verdict(double)>;

// From `good` towards `bad`, to one part in 200 of their distance.
void bisect(const std::string& what, const std::string& setting, double good, double bad,
            const Trial& trial) {
  Verdict verdict = trial(good);
  if (!verdict.holds) {
    fmt::print("{},{},{:.4g},fails there already: {}\n", what, setting, good, verdict.symptom);
    return;
  }
  verdict = trial(bad);
  if (verdict.holds) {
    fmt::print("{},{},{:.4g},none: holds there\n", what, setting, bad);
    return;
  }
  std::string symptom = verdict.symptom;
  for (int round = 0; round < 8; ++round) {
    const double middle = 0.5 * (good + bad);
    verdict = trial(middle);
    (verdict.holds ? good : bad) = middle;
    if (!verdict.holds) symptom = verdict.symptom;
  }
  fmt::print("{},{},{:.4g},{}\n", what, setting, good, symptom);
  std::fflush(stdout);
}

// Stretch across at which a body stretched along x carries no stress across.
double stretch_across(const Block& block, double stretch) {
  const auto stress = [&](double across) {
    std::vector<double> u(2 * block.body.size());
    for (std::size_t i = 0; i < block.body.size(); ++i) {
      u[2 * i] = (stretch - 1) * block.body.position[2 * i];
      u[2 * i + 1] = (across - 1) * block.body.position[2 * i + 1];
    }
    block.solver->evaluate(u);
    return block.solver->first_piola_kirchhoff_at(0).yy;
  };
  double low = 0.8, high = 1;
  while (high < 5 && !(stress(high) > 0)) high += 0.1;
  for (int round = 0; round < 60; ++round) {
    const double middle = 0.5 * (low + high);
    (stress(middle) > 0 ? high : low) = middle;
  }
  return low;
}

// Ends moved to the stretch given: held, or free to slide along them.
Verdict stretched(const Block::Options& options, double stretch) {
  Block::Options o = options;
  o.left = o.right = !o.confined && !o.guided;
  const Block block(o);
  Loading loading;
  if (o.guided) {
    const double across = stretch_across(block, stretch);
    PrescribedMotion side{.particle = {}, .component = 1, .displacement = [=](double, double, double) {
                            return (across - 1) * o.height;
                          }};
    for (std::size_t i = 0; i < block.body.size(); ++i)
      if (block.body.position[2 * i + 1] > o.height - 1e-9)
        side.particle.push_back(static_cast<std::uint32_t>(i));
    loading.prescribed.push_back(side);
  }
  PrescribedMotion motion{.particle = {}, .component = 0, .displacement = [&](double, double, double) {
                            return (stretch - 1) * o.length;
                          }};
  for (std::size_t i = 0; i < block.body.size(); ++i)
    if (block.body.position[2 * i] > o.length - 1e-9)
      motion.particle.push_back(static_cast<std::uint32_t>(i));
  loading.prescribed.push_back(motion);
  NewtonSolver newton(*block.solver, o.law == LawName::neo_hooke || o.law == LawName::neo_hooke_isochoric);
  std::vector<double> u(2 * block.body.size(), 0.0);
  try {
    const auto report = newton.solve(u, loading, 0, {.tolerance = 1e-6, .maximum_steps = 300},
                                     [](double, const std::string&) {});
    if (!report.converged) return {false, "Newton's method finds no equilibrium"};
    if (!report.stable) return {false, "the equilibrium found is unstable"};
  } catch (const Breakdown&) {
    return {false, "a particle is turned inside out"};
  }
  return {true, ""};
}

// A random field of velocities, 1e-6 of the wave speed, must not grow.
Verdict quiet(const Block::Options& o, double courant) {
  const Block block(o);
  State state = at_rest(block.body);
  state.history = block.solver->history();
  std::uint64_t random = 88172645463325252ULL;
  for (double& v : state.velocity) {
    random ^= random << 13U;
    random ^= random >> 7U;
    random ^= random << 17U;
    v = 1e-6 * block.wave_speed * (static_cast<double>(random >> 11U) / 9007199254740992.0 - 0.5);
  }
  const double before = block.solver->kinetic_energy(state);
  const double step = courant * block.body.mean_spacing() / block.wave_speed;
  try {
    block.solver->advance(state, {}, 2000 * step, 2000, 0, [](double, const std::string&) {});
  } catch (const Breakdown&) {
    return {false, "the shortest waves grow without bound"};
  }
  return {block.solver->kinetic_energy(state) < 4 * before, "the shortest waves grow"};
}

// Flies against a smooth wall; must come back.
Verdict bounces(const Block::Options& options, double speed) {
  Block::Options o = options;
  o.slide = true;
  const Block block(o);
  State state = at_rest(block.body);
  state.history = block.solver->history();
  for (std::size_t i = 0; i < block.body.size(); ++i)
    if (!block.body.holds(i, 0)) state.velocity[2 * i] = -speed * block.wave_speed;
  const double duration = 3 * o.length / block.wave_speed;
  const double step = 0.25 * block.body.mean_spacing() / block.wave_speed;
  try {
    block.solver->advance(state, {}, duration, static_cast<std::uint64_t>(duration / step), 0,
                          [](double, const std::string&) {});
  } catch (const Breakdown&) {
    return {false, "a particle is turned inside out"};
  }
  return {true, ""};
}

// Bending of a 10:1 cantilever by a small load at its end must come within a tenth of Timoshenko's beam.
Verdict bends(const Block::Options& options, double poisson, double young, int across) {
  Block::Options o = options;
  o.left = true;
  o.poisson = poisson;
  o.young = young;
  o.across = across;
  o.length = 1;
  o.height = 0.1;
  o.plane = o.law == LawName::saint_venant_kirchhoff ? Plane::stress : Plane::strain;
  const Block block(o);
  const bool strain = o.plane == Plane::strain;
  const double modulus = strain ? young / (1 - poisson * poisson) : young,
               shear = young / (2 * (1 + poisson));
  const double force = 1e-4 * modulus * o.height * o.height * o.height / 4;
  ParticleLoad load;
  const auto rows = static_cast<double>(block.body.columns[1] - 1);
  double y_of_tip = 0;
  std::size_t tip = 0;
  for (std::size_t i = 0; i < block.body.size(); ++i)
    if (block.body.position[2 * i] > 1 - 1e-9) {
      const double y = block.body.position[2 * i + 1];
      const bool corner = y < 1e-9 || y > 0.1 - 1e-9;
      load.particle.push_back(static_cast<std::uint32_t>(i));
      load.end.insert(load.end.end(), {0, force * (corner ? 0.5 : 1.0) / rows});
      if (std::abs(y - 0.05) < std::abs(y_of_tip - 0.05)) {
        y_of_tip = y;
        tip = i;
      }
    }
  load.start = load.end;
  Loading loading;
  loading.loads.push_back(load);
  NewtonSolver newton(*block.solver, o.law == LawName::neo_hooke || o.law == LawName::neo_hooke_isochoric);
  std::vector<double> u(2 * block.body.size(), 0.0);
  const auto report = newton.solve(u, loading, 0, {.tolerance = 1e-6, .maximum_steps = 300},
                                   [](double, const std::string&) {});
  if (!report.converged) return {false, "Newton's method finds no equilibrium"};
  const double exact = 4 * force / (modulus * 1e-3) + 1.2 * force / (shear * 0.1);
  const double ratio = u[2 * tip + 1] / exact;
  return {std::abs(ratio - 1) < 0.1, fmt::format("tip {:.3f} of the beam's", ratio)};
}

// Whether plane waves of every direction travel in a material stretched along x: the acoustic tensor is
// positive definite (strong ellipticity; Ogden 1984, ch. 6.2). Beyond, no method holds.
Verdict elliptic(const Block::Options& o, double stretch) {
  const Block block(o);
  const double across = o.guided ? stretch_across(block, stretch) : 1;
  std::vector<double> u(2 * block.body.size());
  for (std::size_t i = 0; i < block.body.size(); ++i) {
    u[2 * i] = (stretch - 1) * block.body.position[2 * i];
    u[2 * i + 1] = (across - 1) * block.body.position[2 * i + 1];
  }
  block.solver->evaluate(u);
  const auto a = block.solver->tangent_at(0);
  for (int direction = 0; direction < 180; ++direction) {
    const double angle = 3.14159265358979 * direction / 180, n[2] = {std::cos(angle), std::sin(angle)};
    double q[2][2] = {};
    for (std::size_t p = 0; p < 2; ++p)
      for (std::size_t r = 0; r < 2; ++r)
        for (std::size_t c = 0; c < 2; ++c)
          for (std::size_t d = 0; d < 2; ++d) q[p][r] += a[4 * (2 * p + c) + 2 * r + d] * n[c] * n[d];
    const double shear = 0.5 * (q[0][1] + q[1][0]);
    if (!(q[0][0] > 0) || !(q[0][0] * q[1][1] > shear * shear))
      return {false, fmt::format("no wave at {} degrees to the pressure", direction)};
  }
  return {true, ""};
}

const std::vector<std::pair<const char*, LawName>> kLaws{
    {"saint_venant_kirchhoff", LawName::saint_venant_kirchhoff},
    {"hooke_almansi", LawName::hooke_almansi},
    {"neo_hooke", LawName::neo_hooke},
    {"neo_hooke_isochoric", LawName::neo_hooke_isochoric},
    {"j2_plasticity elastic", LawName::j2_plasticity}};

}  // namespace

int main(int argc, char** argv) {
  const auto wanted = [&](const char* name) { return argc < 2 || std::strstr(name, argv[1]) != nullptr; };
  fmt::print("what,setting,limit,symptom beyond\n");
  Block::Options slim;
  slim.length = 5;
  if (wanted("courant")) {
    for (const double young : {1e3, 1e6, 2e11})
      for (const double poisson : {0.3, 0.499}) {
        Block::Options o;
        o.young = young;
        o.poisson = poisson;
        bisect("courant number", fmt::format("E {:g} nu {:g}", young, poisson), 0.3, 2.0,
               [&](double c) { return quiet(o, c); });
      }
    for (const auto& [name, kernel, ratio] : {std::tuple{"cubic h 1.3", Kernel::cubic_spline, 1.3},
                                              std::tuple{"quintic h 0.65", Kernel::quintic_spline, 0.65},
                                              std::tuple{"wendland h 1.2", Kernel::wendland, 1.2}}) {
      Block::Options o;
      o.kernel = kernel;
      o.smoothing_ratio = ratio;
      bisect("courant number", name, 0.3, 2.0, [&](double c) { return quiet(o, c); });
    }
  }
  if (wanted("stretch"))
    for (const double poisson : {0.3, 0.499})
      for (const auto& [name, law] : kLaws) {
        Block::Options o;
        o.law = law;
        o.poisson = poisson;
        bisect("stretch", fmt::format("{} nu {:g}", name, poisson), 1.2, 3.2,
               [&](double s) { return stretched(o, s); });
      }
  if (wanted("compression"))
    for (const double poisson : {0.3, 0.499})
      for (const auto& [name, law] : kLaws) {
        Block::Options o;
        o.law = law;
        o.poisson = poisson;
        bisect("compression", fmt::format("{} nu {:g}", name, poisson), 0.95, 0.28,
               [&](double s) { return stretched(o, s); });
      }
  for (const bool guided : {false, true}) {
    const char* kind = guided ? "guided" : "confined";
    for (const double poisson : {0.3, 0.499})
      for (const auto& [name, law] : kLaws) {
        Block::Options o;
        o.law = law;
        o.poisson = poisson;
        o.confined = !guided;
        o.guided = guided;
        const std::string setting = fmt::format("{} nu {:g}", name, poisson);
        if (wanted(kind))
          bisect(fmt::format("{} compression", kind), setting, 0.999, 0.15,
                 [&](double s) { return stretched(o, s); });
        if (wanted("ellipticity"))
          bisect(fmt::format("ellipticity of the law {}", kind), setting, 0.999, 0.15,
                 [&](double s) { return elliptic(o, s); });
      }
  }
  if (wanted("pad"))
    for (const auto& [name, law] : kLaws) {
      Block::Options o;
      o.law = law;
      o.height = 5;
      o.across = 50;
      bisect("compression of a pad", fmt::format("{} 5 times as wide as high", name), 0.95, 0.28,
             [&](double s) { return stretched(o, s); });
    }
  if (wanted("impact"))
    for (const double viscosity : {0.0, 0.2})
      for (const auto& [name, law] : kLaws) {
        Block::Options o = slim;
        o.law = law;
        o.viscosity = viscosity;
        bisect("impact speed over wave speed", fmt::format("{} viscosity {:g}", name, viscosity), 0.05, 1.5,
               [&](double s) { return bounces(o, s); });
      }
  if (wanted("poisson"))
    for (const int across : {2, 4, 5, 10, 20, 40})
      for (const auto& [name, law] : {kLaws[0], kLaws[3]})
        bisect("poisson's ratio in bending", fmt::format("{} {} across", name, across), 0.0, 0.4999,
               [&](double nu) { return bends({.law = law}, nu, 1e6, across); });
  if (wanted("across"))
    for (const int across : {2, 3, 4, 5, 10, 20, 40})
      for (const double poisson : {0.3, 0.499})
        for (const auto& [name, law] : {kLaws[0], kLaws[3]}) {
          const Verdict verdict = bends({.law = law}, poisson, 1e6, across);
          fmt::print("bending,{} nu {:g} {} across,{},{}\n", name, poisson, across,
                     verdict.holds ? "holds" : "fails", verdict.symptom);
          std::fflush(stdout);
        }
  if (wanted("young"))
    for (const double young : {1e3, 1e6, 2e11}) {
      const Verdict verdict = bends({}, 0.3, young, 10);
      fmt::print("bending,E {:g},{},{}\n", young, verdict.holds ? "holds" : "fails", verdict.symptom);
    }
  return 0;
}
