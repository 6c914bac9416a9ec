// The page, which the build embeds.
#pragma once

namespace pipeline {

extern const char kViewPage[];    // page.html; {{STYLE}}, {{SCRIPT}} and {{NONCE}} are to be filled in
extern const char kViewStyle[];   // page.css
extern const char kViewScript[];  // vectors.js, picture.js, controls.js, crop.js, panel.js

}  // namespace pipeline
