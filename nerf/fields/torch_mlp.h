// The LibTorch implementation of Mlp: forward and backward by its autograd. Only programs that link
// nerf_torch may include this.
#pragma once

#include <string>

namespace nerf {

// Makes MakeMlp return LibTorch networks.
void UseTorch();

// "LibTorch 1.13.0 (CPU)".
std::string TorchVersion();

}  // namespace nerf
