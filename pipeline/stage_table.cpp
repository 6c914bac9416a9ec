#include "pipeline/stage.h"
#include "pipeline/stages.h"

namespace pipeline {

std::span<const StageEntry> StageTable() {
  static constexpr StageEntry kTable[] = {
      {"ingest",
       "choose and clean the pictures of a folder, a glob or a video",
       "ingest",
       "INPUT",
       "ingest/images/ masks/ frames.json",
       RunIngest},
      {"sfm",
       "find where each picture was taken",
       "sfm",
       "ingest/",
       "sfm/transforms.json points.ply sparse/",
       RunSfm},
      {"normalize",
       "move and scale the scene to near 2, far 6; split train and test",
       "scene",
       "sfm/",
       "scene/transforms_{train,test}.json scene.json",
       RunNormalize},
      {"train", "train the radiance field", "train", "scene/", "train/checkpoint.bin curve.csv", RunTrain},
      {"evaluate",
       "score held-out views: PSNR, SSIM, FLIP",
       "evaluate",
       "scene/ train/",
       "evaluate/metrics.json renders/ compare/",
       RunEvaluate},
      {"render", "render the novel-view film", "render", "scene/ train/", "render/novel_view.mp4", RunRender},
      {"report",
       "write one self-contained report.html",
       "report",
       "all of the above",
       "report.html",
       RunReport},
  };
  return kTable;
}

}  // namespace pipeline
