#include "pipeline/report/report_page.h"

namespace pipeline {

const char kReportStyle[] = R"css(
:root { color-scheme: light dark; --paper: #fbfbfa; --card: #ffffff; --ink: #1d1f22; --soft: #676c73; --line: #e2e3e5;
  --blue: #2f6db3; --orange: #c2661a; --track: #eceded; }
@media (prefers-color-scheme: dark) {
  :root { --paper: #16181b; --card: #1e2125; --ink: #e7e8ea; --soft: #9aa0a8; --line: #33373d; --blue: #7fb2ec;
    --orange: #eba368; --track: #2a2e33; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink); font: 16px/1.5 system-ui, sans-serif; }
main { max-width: 1080px; margin: 0 auto; padding: 32px 20px 64px; }
h1 { font-size: 28px; line-height: 1.2; margin: 0; overflow-wrap: anywhere; }
h2 { font-size: 19px; margin: 44px 0 12px; }
h3 { font-size: 15px; margin: 20px 0 6px; }
p { margin: 6px 0; max-width: 75ch; }
.soft, figcaption, .label, th { color: var(--soft); font-size: 14px; }
.cards { display: grid; grid-template-columns: repeat(auto-fit, minmax(128px, 1fr)); gap: 12px; margin: 24px 0; }
.card { background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: 12px; }
.card b { display: block; font-size: 20px; font-weight: 600; line-height: 1.4; white-space: nowrap; font-variant-numeric: tabular-nums; }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 420px), 1fr)); gap: 16px; }
video, canvas, .plot { display: block; width: 100%; border-radius: 10px; border: 1px solid var(--line);
  background: var(--card); }
video { max-height: 78vh; background: #000; }
canvas { aspect-ratio: 16 / 10; cursor: grab; touch-action: pan-y; }
figure { margin: 0 0 18px; }
figure img { display: block; width: 100%; height: auto; border-radius: 6px; }
figcaption { display: flex; flex-wrap: wrap; justify-content: space-between; gap: 2px 16px; padding: 5px 2px 0; }
figcaption b { color: var(--ink); font-weight: 600; }
.columns { display: grid; grid-template-columns: repeat(3, 1fr); gap: 8px; text-align: center; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: 15px; font-variant-numeric: tabular-nums; }
th { text-align: left; font-weight: 500; }
th, td { padding: 6px 12px 6px 0; border-bottom: 1px solid var(--line); vertical-align: top; }
td.n, th.n { text-align: right; white-space: nowrap; }
td.name { overflow-wrap: anywhere; min-width: 9em; }
.bar { display: block; height: 6px; min-width: 90px; margin-top: 9px; border-radius: 3px; background: var(--track); }
.bar i { display: block; height: 100%; border-radius: 3px; background: var(--blue); }
details { margin: 10px 0; }
summary { cursor: pointer; color: var(--blue); }
ul { margin: 4px 0 12px; padding-left: 20px; }
li { margin: 3px 0; overflow-wrap: anywhere; }
pre { background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: 12px 14px; font-size: 13.5px;
  line-height: 1.6; white-space: pre-wrap; overflow-wrap: anywhere; }
.plot { padding: 6px; }
.plot text { fill: var(--soft); font-size: 13px; font-family: inherit; }
.plot .grid { stroke: var(--line); }
.plot polyline { fill: none; stroke-width: 2; stroke-linejoin: round; }
.plot polyline.series-0 { stroke: var(--blue); } .plot text.series-0 { fill: var(--blue); }
.plot polyline.series-1 { stroke: var(--orange); } .plot text.series-1 { fill: var(--orange); }
@media (max-width: 520px) { main { padding: 22px 14px 48px; } h1 { font-size: 23px; }
  .cards { grid-template-columns: repeat(2, 1fr); } canvas { aspect-ratio: 1; } }
@media print { body { background: #fff; } details > * { display: block; } }
)css";

}  // namespace pipeline
