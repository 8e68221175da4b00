// SPDX-License-Identifier: GPL-2.0-or-later
// Loads SDF files with sdformat's parser, and prints every error; exit code 1 if there is one.
#include <iostream>
#include <sdf/sdf.hh>

int main(int count, char **files)
{
  int failed = 0;
  for (int n = 1; n < count; ++n)
  {
    sdf::Root root;
    const sdf::Errors errors = root.Load(files[n]);
    for (const auto &error : errors)
      std::cerr << files[n] << ": " << error.Message() << "\n";
    const sdf::Model *model = root.Model();
    failed += !errors.empty() || !model;
    if (model)
      std::cout << files[n] << ": " << model->LinkCount() << " links, " << model->JointCount() << " joints\n";
  }
  return failed != 0;
}
