#include "compiled_solver.hpp"

namespace estuary::solid {
template std::unique_ptr<Solver> make_solver<NeoHookeIsochoric>(const Body&, const SolverOptions&);
}  // namespace estuary::solid
