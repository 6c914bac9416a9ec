// The page that plays a scene, which the build embeds.
#pragma once

namespace pipeline {

extern const char kScenePage[];       // page.html; its {{NAMES}} are to be filled in
extern const char kScenePageStyle[];  // page.css
// view/vectors.js, payload.js, renderer.js, splats.js, view/controls.js, player.js
extern const char kScenePageScript[];
extern const char kScenePageShader[];  // field.glsl
extern const char kSplatVertexShader[], kSplatFragmentShader[], kMixingShader[];

}  // namespace pipeline
