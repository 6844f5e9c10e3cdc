// toml++ as everything here includes it: without its assertions. It takes some of what it reads for granted,
// so that a table called `[(x]` ends a program that was built with them; behind each of them it goes on to
// say what is wrong with the text.
#pragma once

#define TOML_ASSERT(condition) static_assert(true)
#include <toml++/toml.h>
