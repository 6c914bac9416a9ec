#!/usr/bin/python3
"""Golden values of the original NeRF's training step [Mildenhall et al. 2020], in double, from the formulas of the
paper: python3 nerf_step.py > nerf_step.json. tests/nerf/fields/golden_test.cpp compares the `nerf` field with them.

Only what defines the inputs is taken over from the project: the counter-based random numbers (nerf/random.h), which
rays and distances they pick, and the rounding of these to float."""
import json

import numpy as np

SEED, N_RAYS, N_SAMPLES, NEAR, FAR, STEPS = 7, 8, 16, 2.0, 6.0, 10
DENSITY_SHIFT = 1.25
INIT, RAY, JITTER = 1, 2, 5  # random streams
WIDTH, POSITION, DIRECTION = 256, 63, 27
SHAPES = [(WIDTH, POSITION)] + [(WIDTH, WIDTH)] * 4 + [(WIDTH, POSITION + WIDTH)] + [(WIDTH, WIDTH)] * 2 + [
    (1, WIDTH), (WIDTH, WIDTH), (128, WIDTH + DIRECTION), (3, 128)]
DENSITY, FEATURE, HIDDEN, COLOUR = 8, 9, 10, 11
f32 = np.float32


def mix(z):
    z = np.atleast_1d(z).astype(np.uint64) + np.uint64(0x9e3779b97f4a7c15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xbf58476d1ce4e5b9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94d049bb133111eb)
    return z ^ (z >> np.uint64(31))


def bits(stream, step, index, n=1):
    """The first n random words of each index: [len(index)][n]."""
    key = mix(mix(mix(SEED) ^ np.uint64(stream)) ^ np.uint64(step))
    state = key + np.uint64(0x632be59bd9b4e019) * np.atleast_1d(index).astype(np.uint64)
    return mix((state[:, None] + np.arange(n, dtype=np.uint64)).ravel()).reshape(-1, n)


def make_weights():
    """Uniform in [-5/32, 5/32), exact in float. The shift makes most samples empty at first: rays that are opaque
    throughout have gradients that cancel, and digits with them."""
    count = sum(o * i + o for o, i in SHAPES)
    flat = 5 / 32 * ((bits(INIT, 0, np.arange(count))[:, 0] >> np.uint64(48)).astype(float) / 2**15 - 1)
    weights, at = [], 0
    for o, i in SHAPES:
        weights += [flat[at:at + o * i].reshape(o, i), flat[at + o * i:at + o * i + o]]
        at += o * i + o
    weights[2 * DENSITY + 1] -= DENSITY_SHIFT
    return weights


def make_views():
    """One ray and one RGBA pixel per view, around the origin; all numbers exact in float."""
    a = np.arange(N_RAYS)
    z = (a + 0.5) / N_RAYS * 2 - 1
    out = np.stack([np.sqrt(1 - z * z) * np.cos(2.4 * a), np.sqrt(1 - z * z) * np.sin(2.4 * a), z], 1)
    direction = -np.round(out * 4096) / 4096
    origin = np.round(-4 * direction * 64 + 10 * np.sin(a[:, None] + [1, 2, 3])) / 64
    rgba = np.stack([(37 * a + 11) % 256, (91 * a + 60) % 256, (53 * a + 200) % 256, 255 - 20 * (a % 3)], 1)
    return origin, direction, rgba


def draw(views, step):
    """Rays, targets on white, distances and positions of a training step."""
    origin, direction, rgba = views
    pixel = (bits(RAY, step, 2 * np.arange(N_RAYS))[:, 0] >> np.uint64(32)) * np.uint64(N_RAYS) >> np.uint64(32)
    o, d, target = origin[pixel], direction[pixel], rgba[pixel] / 255
    u = ((bits(JITTER, step, np.arange(N_RAYS), N_SAMPLES) >> np.uint64(40)).astype(float) / 2**24).astype(f32)
    t = f32(NEAR) + (np.arange(N_SAMPLES, dtype=f32) + u) * f32((FAR - NEAR) / N_SAMPLES)
    x = o.astype(f32)[:, None] + t[:, :, None] * d.astype(f32)[:, None]
    alpha = target[:, 3:]
    return x.astype(float), d, t.astype(float), target[:, :3] * alpha + (1 - alpha)


def gamma(p, levels):
    """Eq. 4 without pi, and the identity, as the original code has both."""
    parts = [p]
    for k in range(levels):
        parts += [np.sin(2.0**k * p), np.cos(2.0**k * p)]
    return np.concatenate(parts, -1)


def relu(x):
    return np.maximum(x, 0)


def forward(w, x, d):
    """Fig. 7. Returns raw density, colour logits, and each layer's input."""
    inputs, h = [], x
    for layer in range(8):
        inputs.append(np.concatenate([x, h], 1) if layer == 5 else h)
        h = relu(inputs[-1] @ w[2 * layer].T + w[2 * layer + 1])
    sigma = h @ w[2 * DENSITY].T + w[2 * DENSITY + 1]
    feature = h @ w[2 * FEATURE].T + w[2 * FEATURE + 1]
    hidden_in = np.concatenate([feature, d], 1)
    hidden = relu(hidden_in @ w[2 * HIDDEN].T + w[2 * HIDDEN + 1])
    logits = hidden @ w[2 * COLOUR].T + w[2 * COLOUR + 1]
    return sigma[:, 0], logits, inputs + [h, h, hidden_in, hidden]


def backward(w, inputs, d_sigma, d_logits):
    grads = [None] * len(w)

    def linear(layer, d_out):
        grads[2 * layer], grads[2 * layer + 1] = d_out.T @ inputs[layer], d_out.sum(0)
        return d_out @ w[2 * layer]

    d_hidden = linear(COLOUR, d_logits) * (inputs[COLOUR] > 0)
    d_h = linear(FEATURE, linear(HIDDEN, d_hidden)[:, :WIDTH]) + linear(DENSITY, d_sigma[:, None])
    for layer in range(7, -1, -1):
        after = inputs[layer + 1][:, -WIDTH:]  # this layer's activations
        d_h = linear(layer, d_h * (after > 0))[:, -WIDTH:]
    return grads


def render(w, batch):
    """Eq. 3 with the last interval 1e10, on white; mean squared error."""
    x, d, t, target = batch
    shape = t.shape
    codes = gamma(x, 10).reshape(-1, POSITION), np.repeat(gamma(d, 4), N_SAMPLES, 0)
    raw, logits, inputs = forward(w, *codes)
    delta = np.append(t[:, 1:] - t[:, :-1], np.full((N_RAYS, 1), 1e10), 1)
    alpha = 1 - np.exp(-relu(raw).reshape(shape) * delta)
    light = np.cumprod(np.append(np.ones((N_RAYS, 1)), 1 - alpha, 1), 1)
    weights = light[:, :-1] * alpha
    rgb = (1 / (1 + np.exp(-logits))).reshape(shape + (3,))
    colour = (weights[:, :, None] * rgb).sum(1) + (1 - weights.sum(1))[:, None]
    error = colour - target
    d_colour = 2 * error / error.size
    # More of weight i puts its colour in the place of white; more optical depth at i also dims what lies behind.
    d_weight = (d_colour[:, None] * (rgb - 1)).sum(2)
    seen = d_weight * weights
    behind = seen.sum(1, keepdims=True) - np.cumsum(seen, 1)
    d_raw = (d_weight * light[:, 1:] - behind) * delta * (raw.reshape(shape) > 0)
    d_logits = d_colour[:, None] * weights[:, :, None] * rgb * (1 - rgb)
    return {"codes": codes, "raw": raw, "logits": logits, "weights": weights, "colour": colour,
            "loss": (error**2).mean(), "grads": backward(w, inputs, d_raw.ravel(), d_logits.reshape(-1, 3))}


def check_gradients(w, batch, grads):
    for k, g in enumerate(grads):
        at = np.unravel_index(np.argmax(np.abs(g)), g.shape)
        old, losses = w[k][at], []
        for h in (1e-6, -1e-6):
            w[k][at] = old + h
            losses.append(render(w, batch)["loss"])
        w[k][at] = old
        assert abs((losses[0] - losses[1]) / 2e-6 - g[at]) <= 1e-4 * abs(g[at]), (k, g[at])


def summary(k, g):
    """A tensor without its size: norm, 16 projections on random signs, which estimate the norm of any error, and 256
    entries."""
    flat = g.ravel()
    signs = 1 - 2.0 * (bits(INIT, 1 + k, np.arange(flat.size), 16) >> np.uint64(63)).astype(float)
    stride = max(1, flat.size // 256)
    return {"norm": np.linalg.norm(flat), "projections": list(flat @ signs), "stride": stride,
            "entries": list(flat[::stride])}


def rounded(x):
    if isinstance(x, dict):
        return {k: rounded(v) for k, v in x.items()}
    if isinstance(x, (list, np.ndarray)):
        return [rounded(v) for v in x]
    return int(x) if isinstance(x, (int, np.integer)) else float("%.10g" % x)


def main():
    w, views = make_weights(), make_views()
    batch = draw(views, 0)
    first = render(w, batch)
    check_gradients(w, batch, first["grads"])
    golden = {
        "origins": views[0].ravel(), "directions": views[1].ravel(), "rgba": views[2].ravel(),
        "distances": batch[2].ravel(), "position_codes": first["codes"][0][:4 * N_SAMPLES:2].ravel(),
        "direction_codes": first["codes"][1][::N_SAMPLES].ravel(), "raw": first["raw"],
        "logits": first["logits"].ravel(), "weights": first["weights"].ravel(), "colours": first["colour"].ravel(),
        "loss": first["loss"], "gradients": [summary(k, g) for k, g in enumerate(first["grads"])]}
    m, v, losses = [0 * x for x in w], [0 * x for x in w], []
    for step in range(STEPS):
        result = render(w, draw(views, step))
        losses.append(result["loss"])
        for k, g in enumerate(result["grads"]):
            m[k] = 0.9 * m[k] + 0.1 * g
            v[k] = 0.999 * v[k] + 0.001 * g * g
            w[k] = w[k] - 5e-4 * (m[k] / (1 - 0.9**(step + 1))) / (np.sqrt(v[k] / (1 - 0.999**(step + 1))) + 1e-8)
    golden["losses"] = losses
    print(json.dumps(rounded(golden)))


main()
