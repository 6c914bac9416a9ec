// make_capture: renders the sample capture.
#include <algorithm>
#include <cstdio>
#include <string>
#include <thread>

#include "pipeline/stage/guarded_main.h"
#include "pipeline/stage/options.h"
#include "samples/capture.h"

int main(int argc, char** argv) {
  return pipeline::GuardedMain("make_capture", [&] {
    samples::CaptureOptions capture;
    std::string kind = "photos";
    capture.threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    pipeline::Options options("make_capture",
                              "Photographs a still life that exists only here, and writes the truth beside.");
    options.Add("out", &capture.out, "folder to write; an earlier capture there is replaced");
    options.Add("kind", &kind, "photos, video, rotation, blank or forward");
    options.Add("photos", &capture.photos, "number of photographs");
    options.Add("width", &capture.width, "width of the pictures [px], a multiple of 8");
    options.Add("seed", &capture.seed, "of paint, hand and sensor");
    options.Add("threads", &capture.threads, "does not change the result");
    options.Add("depth", &capture.depth, "also write the depth of every tenth photograph");
    if (!options.Parse(argc, argv)) return;
    capture.kind = samples::ParseCaptureKind(kind);
    const samples::CaptureReport report = samples::WriteCapture(capture);
    std::printf("%s: %d pictures in %.1f s\n", capture.out.c_str(), report.pictures, report.wall_s);
  });
}
