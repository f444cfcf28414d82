// SPDX-License-Identifier: MIT
#include "arrays.hpp"
#include "stemvo/version.hpp"

NB_MODULE(_core, module) {
  module.doc() = "Monocular visual odometry: images in, poses out";
  module.attr("__version__") = std::string(stemvo::version()).c_str();
  stemvo::python::bind_recordings(module);
  stemvo::python::bind_options(module);
  stemvo::python::bind_results(module);
  stemvo::python::bind_odometry(module);
  stemvo::python::bind_evaluation(module);
  stemvo::python::bind_studies(module);
  stemvo::python::bind_tracking(module);
}
