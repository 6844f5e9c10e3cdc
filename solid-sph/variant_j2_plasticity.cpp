#include "compiled_solver.hpp"

namespace estuary::solid {
template std::unique_ptr<Solver> make_solver<J2Plasticity>(const Body&, const SolverOptions&);
}  // namespace estuary::solid
