// Views cut out of one panorama: taken from one place, turned against each other by known angles. One of them
// that is posed gives the poses of all.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "sfm/bundle/bundle_uncertainty.h"
#include "sfm/reconstruction.h"

namespace sfm {

// Pictures that are posed, or whose panorama has a view that is.
int PosedWithRigs(const std::vector<Picture>& pictures, const std::set<std::string>& posed);

struct RigReport {
  int n_rigs = 0, n_added = 0;  // panoramas with a posed view; views that had no pose, or a wrong one
  double rotation_deg = 0;      // median angle between a view as it was posed alone, and as it is now
};

// Poses all views of every panorama that has a posed one, and adjusts the model anew with one pose per
// panorama, the cameras of views as they were cut out, and other cameras held. The view that most others
// agree with places its panorama at first; those that disagree, by more than 2 degrees, lose their
// observations. title: of the progress. Does nothing without panoramas.
RigReport JoinRigs(const std::vector<Picture>& pictures,
                   const std::string& title,
                   io::ColmapModel* model,
                   BundleUncertainty* uncertainty);

}  // namespace sfm
