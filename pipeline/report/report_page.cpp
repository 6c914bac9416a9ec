#include "pipeline/report/report_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "io/base/atomic_file.h"
#include "io/base/base64.h"
#include "io/image/colour_map.h"
#include "io/image/image.h"
#include "io/process/progress.h"
#include "pipeline/evaluation/evaluation.h"
#include "pipeline/evaluation/verdict.h"
#include "pipeline/report/budget_section.h"
#include "pipeline/report/plot_svg.h"

namespace pipeline {
namespace {

// Three stand beside one another on a wide screen; more pixels only make the file larger.
constexpr int kMaxPictureWidth = 480;
constexpr std::size_t kOpenFigures = 4;  // the others are folded away
constexpr std::size_t kShownLeftOut = 6;
constexpr std::size_t kPlainRows = 12;  // longer lists are folded away

std::string Soft(const std::string& text) { return "<p class=\"soft\">" + EscapeHtml(text) + "</p>\n"; }

std::string Megabytes(double bytes) { return fmt::format("{:.0f} MB", bytes / 1e6); }

std::string Card(const std::string& figure, const std::string& label) {
  return "<div class=\"card\"><b>" + EscapeHtml(figure) + "</b><span class=\"label\">" + EscapeHtml(label) +
         "</span></div>\n";
}

// What is wrong with the result, before any figure.
std::string VerdictLine(const ReportData& data) {
  const Verdict verdict = Judge(data.scores);
  if (verdict.outcome == Outcome::kReconstructed) return "";
  const char* start = verdict.outcome == Outcome::kFailed ? "Not reconstructed: " : "Doubtful: ";
  return "<p class=\"verdict\">" + EscapeHtml(start + verdict.text) + ".</p>\n";
}

std::string Headlines(const ReportData& data) {
  std::string html = data.has_scores ? VerdictLine(data) : "";
  html += "<div class=\"cards\">\n";
  if (data.has_ingest) {
    html += Card(fmt::format("{}", data.kept), fmt::format("pictures kept, {} dropped", data.dropped));
  }
  if (data.has_sfm)
    html += Card(fmt::format("{} of {}", data.registered, data.images), "pictures registered");
  if (data.has_scores) {
    const std::optional<ErrorBudget>& budget = data.scores.budget;
    html += Card(fmt::format("{:.2f} dB", data.scores.psnr_db),
                 fmt::format("PSNR on unseen views, {}; {:.2f} with colours aligned{}",
                             data.scores.protocol,
                             data.scores.aligned_psnr_db,
                             budget ? fmt::format(", {:+.2f} with their own poses fitted",
                                                  budget->fitted_psnr_db - budget->psnr_db)
                                    : ""));
    html += Card(fmt::format("{:.3f}", data.scores.ssim), "SSIM, 1 is perfect");
    html += Card(fmt::format("{:.3f}", data.scores.flip), "FLIP, 0 is perfect");
  }
  if (data.train_s > 0) html += Card(io::FormatDuration(data.train_s), "training");
  html += Card(io::FormatDuration(data.total_wall_s), "in all");
  return html + "</div>\n";
}

std::string VideoElement(const std::filesystem::path& mp4, const char* more) {
  return std::string("<video controls muted loop playsinline ") + more + " src=\"data:video/mp4;base64," +
         io::Base64(io::ReadFile(mp4)) + "\"></video>\n";
}

// A picture as a JPEG inside the page.
std::string PictureElement(const io::Image& picture, const std::string& what) {
  const int width = std::min(picture.width, kMaxPictureWidth);
  const double height = static_cast<double>(picture.height) * width / picture.width;
  const io::Image shown = io::ResizeArea(picture, width, std::max(1, static_cast<int>(std::lround(height))));
  const std::vector<std::uint8_t> jpeg = io::EncodeImage(shown, ".jpg");
  return "<img alt=\"" + what + "\" src=\"data:image/jpeg;base64," +
         io::Base64(std::string(jpeg.begin(), jpeg.end())) + "\">";
}

std::string PictureElement(const std::filesystem::path& path, const std::string& what) {
  return PictureElement(io::ReadImage(path), what);
}

// The colours of turbo from left to right, between the captions of both ends.
std::string Scale(const std::string& low, const std::string& high) {
  constexpr int kLevels = 256;
  std::vector<float> levels;
  for (int i = 0; i < kLevels; ++i) levels.push_back(static_cast<float>(i) / (kLevels - 1));
  const std::vector<std::uint8_t> png =
      io::EncodeImage(io::ApplyColourMap(levels, kLevels, 1, io::ColourMap::kTurbo), ".png");
  return "<span class=\"scale\">" + low + " <img alt=\"blue to red\" src=\"data:image/png;base64," +
         io::Base64(std::string(png.begin(), png.end())) + "\"> " + high + "</span>";
}

std::string SupportPart(const ReportData& data) {
  if (data.support.empty()) return "";
  std::string html =
      "<h3>Support</h3>\n" + Soft(
                                 "How many training views saw the surface that a pixel shows, and the "
                                 "largest angle between two of them. Black: none saw it.");
  html += "<div class=\"columns soft\"><span>film</span>" + Scale("one view", "all") +
          Scale("0\u00b0", fmt::format("{:.0f}\u00b0", kLargestAngle_deg)) + "</div>\n";
  for (const SupportPictures& pictures : data.support) {
    html += "<figure><div class=\"columns\">" + PictureElement(pictures.picture, "film") +
            PictureElement(pictures.views, "number of views") + PictureElement(pictures.angle, "angle") +
            "</div><figcaption><span>" + fmt::format("frame {}", pictures.frame + 1) +
            "</span></figcaption></figure>\n";
  }
  if (!data.support_film.empty())
    html += VideoElement(data.support_film, "") + Soft("Blue: one view, red: all.");
  return html;
}

std::string FilmSection(const ReportData& data) {
  std::string html = "<h2>Film</h2>\n";
  if (data.has_scene_page)
    html +=
        "<p><a href=\"scene.html\">Look around in the scene</a> (scene.html beside this page, for any "
        "browser with WebGL 2)</p>\n";
  if (data.film.empty()) return html + Soft("No film: the stage render has not finished.");
  html += VideoElement(data.film, "autoplay");
  if (data.film_ms_per_frame > 0) {
    html += Soft(fmt::format("{} frames, {:.0f} ms each.", data.film_frames, data.film_ms_per_frame));
  }
  if (!data.depth_film.empty()) {
    html += "<h3>Depth</h3>\n" + VideoElement(data.depth_film, "") + Soft("Near is blue, far is red.");
  }
  return html + SupportPart(data);
}

std::string ComparisonFigure(const ComparedView& view, std::size_t rank) {
  return "<figure><div class=\"columns\">" + PictureElement(view.pictures->photo, "truth") +
         PictureElement(view.pictures->render, "render") + PictureElement(view.pictures->error, "error") +
         "</div><figcaption><span>" + fmt::format("{}. ", rank) + EscapeHtml(view.score.name) +
         "</span><span><b>" + fmt::format("{:.2f} dB", view.score.psnr_db) + "</b> " +
         fmt::format("SSIM {:.3f}, FLIP {:.3f}", view.score.ssim, view.score.flip) +
         "</span></figcaption></figure>\n";
}

std::string ViewsSection(const ReportData& data) {
  std::string html = "<h2>Unseen views, worst first</h2>\n";
  if (!data.has_scores) return html + Soft("No scores: the stage evaluate has not finished.");
  html += Soft(
      fmt::format("{} pictures were held out of training. Error is FLIP, what an eye sees when it switches "
                  "between truth and render: black is none, yellow is most.",
                  data.views.size()));
  std::string open, folded, rows;
  std::size_t rank = 0, n_folded = 0;
  for (const ComparedView& view : data.views) {
    ++rank;
    rows += "<tr><td class=\"name\">" + EscapeHtml(view.score.name) + "</td>" +
            fmt::format(
                "<td class=\"n\">{:.2f}</td><td class=\"n\">{:.2f}</td><td class=\"n\">{:.4f}</td>"
                "<td class=\"n\">{:.4f}</td></tr>\n",
                view.score.psnr_db,
                view.score.aligned_psnr_db,
                view.score.ssim,
                view.score.flip);
    if (!view.pictures) continue;
    (rank <= kOpenFigures ? open : folded) += ComparisonFigure(view, rank);
    n_folded += rank > kOpenFigures;
  }
  if (!open.empty()) {
    html +=
        "<div class=\"columns soft\"><span>truth</span><span>render</span><span>error</span></div>\n" + open;
  }
  if (n_folded > 0)
    html += fmt::format("<details><summary>{} more</summary>\n", n_folded) + folded + "</details>\n";
  return html +
         "<details><summary>All figures</summary><div class=\"scroll\"><table><tr><th>picture</th><th "
         "class=\"n\">PSNR, dB</th><th class=\"n\">colours aligned, dB</th><th class=\"n\">SSIM</th><th "
         "class=\"n\">FLIP</th></tr>\n" +
         rows + "</table></div></details>\n";
}

std::string ScenePart(const ReportData& data) {
  if (data.scene_json.empty()) return Soft("No scene: the stage normalize has not finished.");
  std::string json = data.scene_json;  // numbers only, but "</" must never stand in a script element
  for (std::size_t at = 0; (at = json.find("</", at)) != std::string::npos; at += 3)
    json.insert(at + 1, 1, '\\');
  return "<div><canvas id=\"scene\"></canvas><script type=\"application/json\" id=\"scene-data\">" + json +
         "</script>\n" +
         Soft(
             "Drag to turn, scroll to zoom. Blue cameras were trained on, orange ones held out; the dashed "
             "line "
             "is the film's path.") +
         "</div>\n";
}

std::string CurvePart(const ReportData& data) {
  std::vector<double> minutes;
  const bool in_minutes = !data.curve.wall_s.empty() && data.curve.wall_s.back() > 180;
  for (const double s : data.curve.wall_s) minutes.push_back(in_minutes ? s / 60 : s);
  const std::string x_label = in_minutes ? "minutes of training" : "seconds of training";
  const std::string psnr = PlotSvg({{"training rays", minutes, data.curve.train_psnr},
                                    {"held-out views", minutes, data.curve.heldout_psnr}},
                                   {x_label, "PSNR, dB"});
  const std::string loss = PlotSvg({{"loss", minutes, data.curve.loss}}, {x_label, "loss", true});
  if (psnr.empty() && loss.empty()) return Soft("No training curve: train/curve.csv is missing or empty.");
  std::string facts;
  if (!data.field.empty()) facts = "Field " + data.field;
  if (data.train_parameters > 0)
    facts += fmt::format(", {:.2f} million parameters", data.train_parameters / 1e6);
  if (data.train_steps > 0) facts += fmt::format(", {:.0f} steps", data.train_steps);
  return "<div class=\"pair\">" + psnr + loss + "</div>\n" + (facts.empty() ? "" : Soft(facts + "."));
}

std::string StagesSection(const ReportData& data) {
  double longest = 0;
  for (const StageSummary& stage : data.stages) longest = std::max(longest, stage.wall_s);
  std::string html =
      "<h2>Time and memory</h2>\n<div class=\"scroll\"><table><tr><th>stage</th><th></th><th "
      "class=\"n\">wall</th><th class=\"n\">CPU</th><th class=\"n\">memory</th><th></th></tr>\n";
  for (const StageSummary& stage : data.stages) {
    html += "<tr><td>" + stage.name + "</td><td class=\"soft\">" + EscapeHtml(stage.help) + "</td>";
    if (!stage.done) {
      html += "<td class=\"n soft\" colspan=\"3\">not run</td><td></td></tr>\n";
      continue;
    }
    html += "<td class=\"n\">" + io::FormatDuration(stage.wall_s) + "</td><td class=\"n\">" +
            io::FormatDuration(stage.cpu_s) + "</td><td class=\"n\">" + Megabytes(stage.peak_rss_bytes) +
            "</td><td><span class=\"bar\"><i style=\"width:" +
            fmt::format("{:.1f}%", longest > 0 ? 100 * stage.wall_s / longest : 0.0) +
            "\"></i></span></td></tr>\n";
  }
  return html + "</table></div>\n" + (data.host.empty() ? "" : Soft("Machine: " + data.host + "."));
}

std::string LeftOutPart(const ReportData& data) {
  if (data.left_out.empty()) return "";
  std::string html =
      "<h3>Left out</h3>\n" +
      Soft(fmt::format("Training pictures that show what the others do not, such as passers-by: {}. The dark "
                       "parts were not trained on; train/masks/ has them as masks.",
                       data.left_out.size()));
  html += "<div class=\"columns\">";
  for (std::size_t i = 0; i < std::min(data.left_out.size(), kShownLeftOut); ++i) {
    const io::Frame& frame = data.left_out[i].frame;
    const auto [picture, mask] = ReadTruth(frame);
    html += PictureElement(DarkenUnused(picture, mask), EscapeHtml(frame.image_path.filename().string()));
  }
  return html + "</div>\n";
}

std::string PictureTable(const std::string& title, const std::vector<NamedText>& rows) {
  if (rows.empty()) return "";
  std::string html = fmt::format(
      "<details{}><summary>{} ({})</summary>", rows.size() <= kPlainRows ? " open" : "", title, rows.size());
  html += "<div class=\"scroll\"><table>\n";
  for (const NamedText& row : rows) {
    html += "<tr><td class=\"name\">" + EscapeHtml(row.name) + "</td><td>" + EscapeHtml(row.text) +
            "</td></tr>\n";
  }
  return html + "</table></div></details>\n";
}

std::string PicturesSection(const ReportData& data) {
  std::string html = "<h2>Pictures</h2>\n";
  if (!data.has_ingest) html += Soft("No ingest record: the input came with poses.");
  if (data.has_ingest) html += Soft(fmt::format("{} kept, {} dropped.", data.kept, data.dropped));
  if (data.has_sfm) {
    html += Soft(fmt::format("{} of {} registered; {} points, mean reprojection error {:.2f} px.",
                             data.registered,
                             data.images,
                             data.points,
                             data.reprojection_error_px));
  }
  if (data.masks > 0) {
    html += Soft(fmt::format(
        "Masks of {} pictures leave {:.0f} % of all pixels, the only ones to be trained on and scored.",
        data.masks,
        100 * data.used_share));
  }
  html += PictureTable("Dropped, and why", data.dropped_pictures);
  html += PictureTable("Not registered, and why", data.unregistered);
  html += PictureTable("How well each pose is known (one standard deviation)", data.pose_uncertainties);
  std::vector<NamedText> noted = data.kept_pictures;
  std::erase_if(noted, [](const NamedText& picture) { return picture.text.empty(); });
  return html + PictureTable("Kept, with a note", noted);
}

std::string DecisionsSection(const ReportData& data) {
  std::string html = "<h2>What was chosen, and why</h2>\n";
  for (const StageSummary& stage : data.stages) {
    if (stage.decisions.empty()) continue;
    html += "<h3>" + stage.name + "</h3><ul>\n";
    for (const std::string& line : stage.decisions) html += "<li>" + EscapeHtml(line) + "</li>\n";
    html += "</ul>\n";
  }
  return html;
}

std::string CommandsSection(const ReportData& data) {
  std::string html = "<h2>Commands</h2>\n";
  if (!data.run_command.empty()) html += "<pre>" + EscapeHtml(data.run_command) + "</pre>\n";
  std::string stages;
  for (const StageSummary& stage : data.stages) {
    if (!stage.command.empty()) stages += EscapeHtml(stage.command) + "\n";
  }
  if (!stages.empty()) html += Soft("Stage by stage:") + "<pre>" + stages + "</pre>\n";
  return html + (data.versions.empty() ? "" : Soft("Versions: " + data.versions + "."));
}

}  // namespace

std::string ReportPage(const ReportData& data) {
  const std::string title = EscapeHtml(data.name);
  return "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
         "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; "
         "media-src data:; "
         "style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\n"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>" +
         title + "</title>\n<style>" + kReportStyle + "</style></head>\n<body><main>\n<h1>" + title +
         "</h1>\n" + (data.input.empty() ? "" : Soft("From " + data.input)) + Headlines(data) +
         FilmSection(data) + ViewsSection(data) + BudgetSection(data.scores) +
         "<h2>Cameras and points</h2>\n" + ScenePart(data) + "<h2>Training</h2>\n" + CurvePart(data) +
         LeftOutPart(data) + StagesSection(data) + PicturesSection(data) + DecisionsSection(data) +
         CommandsSection(data) + "</main>\n<script>" + kReportScript + "</script>\n</body></html>\n";
}

}  // namespace pipeline
