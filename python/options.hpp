// SPDX-License-Identifier: MIT
#pragma once

#include <nanobind/nanobind.h>

#include "config/config.hpp"

namespace stemvo::python {

/// The configuration of Options, a dict of keys and values, or None: the defaults.
/// ValueError: of none.
[[nodiscard]] Config config_of(const nanobind::object& options);

}  // namespace stemvo::python
