// Expressions of the keys that a study varies: exact references, settings that follow from others.
#pragma once

#include <map>
#include <string>

namespace estuary::coupler {

/// The value of a muParser expression; `pi` is known besides the variables. Throws std::invalid_argument with
/// what is wrong with it, also when the value is not finite.
double evaluate_expression(const std::string& text, const std::map<std::string, double>& variables);

}  // namespace estuary::coupler
