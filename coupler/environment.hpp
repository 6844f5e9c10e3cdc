// The machine and the program, for the end of a page.
#pragma once

#include <string>
#include <vector>

namespace estuary::coupler {

/// Rows of name and value: time, version, compiler, system, processor.
std::vector<std::vector<std::string>> environment_rows();

}  // namespace estuary::coupler
