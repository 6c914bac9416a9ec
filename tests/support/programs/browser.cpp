#include "tests/support/programs/browser.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <thread>

#include "io/base/json.h"

namespace {

constexpr int kAnswer_ms = 30000;
// The protocol's ends in the browser.
constexpr int kReads = 3, kWrites = 4;

[[noreturn]] void RunChromium(int reads, int writes, const std::string& profile) {
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  // Out of the way first, since one may stand where the other belongs.
  const int reads_aside = fcntl(reads, F_DUPFD, 10), writes_aside = fcntl(writes, F_DUPFD, 10);
  dup2(reads_aside, kReads);
  dup2(writes_aside, kWrites);
  const int nowhere = open("/dev/null", O_RDWR);
  dup2(nowhere, 1);
  dup2(nowhere, 2);
  const std::string folder = "--user-data-dir=" + profile;
  execlp("chromium",
         "chromium",
         "--headless=new",
         "--no-sandbox",
         "--use-gl=angle",  // WebGL in software, the same on every machine
         "--use-angle=swiftshader",
         "--enable-unsafe-swiftshader",
         "--disable-dev-shm-usage",
         "--remote-debugging-pipe",
         folder.c_str(),
         "about:blank",
         nullptr);
  _exit(127);
}

}  // namespace

Browser::Browser(const std::string& url, int width, int height) {
  int to[2], from[2];
  if (pipe(to) != 0 || pipe(from) != 0) throw std::runtime_error("no pipes");
  pid_ = fork();
  if (pid_ == 0) RunChromium(to[0], from[1], profile_.path().string());
  close(to[0]);
  close(from[1]);
  to_ = to[1];
  from_ = from[0];
  const io::Json target = Call("Target.createTarget", {{"url", "about:blank"}});
  session_ =
      Call("Target.attachToTarget", {{"targetId", target["targetId"]}, {"flatten", true}})["sessionId"];
  Call("Emulation.setDeviceMetricsOverride",
       {{"width", width}, {"height", height}, {"deviceScaleFactor", 1}, {"mobile", false}});
  Call("Page.navigate", {{"url", url}});
  if (!Becomes("location.href !== 'about:blank' && document.readyState === 'complete'"))
    throw std::runtime_error(url + " does not load");
}

Browser::~Browser() {
  kill(-pid_, SIGKILL);
  waitpid(pid_, nullptr, 0);
  close(to_);
  close(from_);
}

io::Json Browser::Receive() {
  std::size_t end;
  while ((end = received_.find('\0')) == std::string::npos) {
    pollfd ready = {from_, POLLIN, 0};
    char buffer[1 << 16];
    const ssize_t n = poll(&ready, 1, kAnswer_ms) == 1 ? read(from_, buffer, sizeof buffer) : 0;
    if (n <= 0) throw std::runtime_error("chromium does not answer");
    received_.append(buffer, static_cast<std::size_t>(n));
  }
  const io::Json message = io::ParseJson(received_.substr(0, end));
  received_.erase(0, end + 1);
  return message;
}

io::Json Browser::Call(const std::string& method, const io::Json& parameters) {
  io::Json message = {{"id", ++id_}, {"method", method}, {"params", parameters}};
  if (!session_.empty()) message["sessionId"] = session_;
  const std::string text = io::DumpJson(message);
  if (write(to_, text.c_str(), text.size() + 1) != static_cast<ssize_t>(text.size() + 1))
    throw std::runtime_error("chromium has ended");
  for (;;) {
    const io::Json answer = Receive();
    if (answer.value("id", 0) != id_) continue;  // an event
    if (answer.contains("error")) throw std::runtime_error(method + ": " + io::DumpJson(answer["error"]));
    return answer["result"];
  }
}

io::Json Browser::Evaluate(const std::string& expression) {
  const io::Json answer =
      Call("Runtime.evaluate", {{"expression", expression}, {"returnByValue", true}, {"awaitPromise", true}});
  if (answer.contains("exceptionDetails")) throw std::runtime_error(io::DumpJson(answer["exceptionDetails"]));
  return answer["result"].value("value", io::Json());
}

bool Browser::Becomes(const std::string& expression) {
  for (int i = 0; i < 400; ++i) {
    if (Evaluate("Boolean(" + expression + ")") == true) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return false;
}

void Browser::Mouse(const std::string& type, double x, double y, const io::Json& more) {
  io::Json parameters = {{"type", type}, {"x", x}, {"y", y}};
  parameters.update(more);
  Call("Input.dispatchMouseEvent", parameters);
}

void Browser::Drag(double x, double y, double to_x, double to_y) {
  constexpr int kSteps = 5;
  Mouse("mousePressed", x, y, {{"button", "left"}, {"buttons", 1}, {"clickCount", 1}});
  for (int i = 1; i <= kSteps; ++i) {
    const double share = static_cast<double>(i) / kSteps;
    Mouse("mouseMoved", x + share * (to_x - x), y + share * (to_y - y), {{"button", "left"}, {"buttons", 1}});
  }
  Mouse("mouseReleased", to_x, to_y, {{"button", "left"}, {"clickCount", 1}});
}

void Browser::Wheel(double x, double y, double delta) {
  Mouse("mouseWheel", x, y, {{"deltaX", 0}, {"deltaY", delta}});
}

void Browser::Key(const std::string& key, const std::string& type) {
  Call("Input.dispatchKeyEvent", {{"type", type}, {"key", key}, {"text", type == "keyDown" ? key : ""}});
}

void Browser::Screenshot(const std::filesystem::path& png) {
  const std::string base64 = Call("Page.captureScreenshot", {{"format", "png"}})["data"];
  WriteText(png, FromBase64(base64));
}

std::string FromBase64(const std::string& base64) {
  std::string bytes;
  unsigned bits = 0;
  int n_bits = 0;
  const std::string alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (const char letter : base64) {
    const std::size_t value = alphabet.find(letter);
    if (value == std::string::npos) break;  // padding
    bits = bits << 6 | static_cast<unsigned>(value);
    if ((n_bits += 6) >= 8) bytes += static_cast<char>(bits >> (n_bits -= 8));
  }
  return bytes;
}
