// The page's server: what it answers, whom it refuses, and that it survives hostile clients.
#include "pipeline/view/view_server.h"
#include "io/base/json.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <httplib.h>
#include <sys/socket.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "io/base/error.h"
#include "pipeline/film/camera_path_file.h"
#include "pipeline/stages/training_watch.h"
#include "tests/support/files/small_run.h"

namespace pipeline {
namespace {

namespace fs = std::filesystem;
using io::Json;
using testing::HasSubstr;

class ViewServerTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    small_ = new tests::SmallRun();
    small_->Train("train");
  }
  static void TearDownTestSuite() { delete small_; }

  // As the page asks.
  httplib::Result Get(const std::string& path) { return client_.Get(path.c_str(), token_); }
  std::string FramePath(const std::string& layer, int sequence, const std::string& extra = "") const {
    std::string pose;
    for (const double value : RowsOf(small_->scene().frames[0].world_from_cam))
      pose += (pose.empty() ? "" : ",") + std::to_string(value);
    return "/frame?viewer=a&fov=0.8&width=48&height=32&quality=0&layer=" + layer + "&pose=" + pose +
           "&sequence=" + std::to_string(sequence) + extra;
  }
  // A connection that nobody has said anything on yet.
  int Connect(bool waits = true) const {
    const int s = socket(AF_INET, waits ? SOCK_STREAM : SOCK_STREAM | SOCK_NONBLOCK, 0);
    sockaddr_in address = {};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(server_.port()));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const int result = connect(s, reinterpret_cast<sockaddr*>(&address), sizeof address);
    EXPECT_TRUE(result == 0 || !waits);
    return s;
  }
  static void Say(int s, const std::string& text) {
    EXPECT_EQ(send(s, text.data(), text.size(), MSG_NOSIGNAL), static_cast<ssize_t>(text.size()));
  }

  static inline tests::SmallRun* small_ = nullptr;
  LiveRun run_{small_->path(), 1};
  FrameMaker maker_{1, 0.2};
  ViewServer server_{&run_, &maker_, {}};
  httplib::Client client_{"127.0.0.1", server_.port()};
  httplib::Headers token_{{"X-Token", server_.token()}};
};

TEST_F(ViewServerTest, ThePageCarriesItsStyleAndScriptAndNothingElse) {
  const auto page = client_.Get(("/?token=" + server_.token()).c_str());
  ASSERT_TRUE(page);
  EXPECT_EQ(page->status, 200);
  EXPECT_THAT(page->body, HasSubstr("createImageBitmap"));
  EXPECT_EQ(page->body.find("{{"), std::string::npos);
  EXPECT_THAT(page->get_header_value("Content-Security-Policy"), HasSubstr("default-src 'none'"));
}

TEST_F(ViewServerTest, TellsSceneStateAndPhotos) {
  const Json scene = io::ParseJson(Get("/scene")->body);
  EXPECT_EQ(scene["cameras"].size(), 8u);
  EXPECT_EQ(scene["name"], "a run");
  const Json state = io::ParseJson(Get("/state")->body);
  EXPECT_EQ(state["shows"], "field");
  EXPECT_EQ(state["finished"], true);
  EXPECT_EQ(state["training"], nullptr);
  const auto photo = Get("/photo?index=7");
  EXPECT_EQ(photo->status, 200);
  EXPECT_EQ(photo->body.substr(0, 3), "\xff\xd8\xff");
  for (const char* index : {"8", "-1", "", "x", "1e9", "nan"})
    EXPECT_EQ(Get(std::string("/photo?index=") + index)->status, 400) << index;
}

TEST_F(ViewServerTest, BeforeThereArePosesThereIsNothingToShow) {
  const TempDir dir;
  LiveRun run(dir.path(), 1);
  ViewServer server(&run, &maker_, {});
  httplib::Client client("127.0.0.1", server.port());
  const httplib::Headers token = {{"X-Token", server.token()}};
  const auto get = [&](const std::string& path) { return client.Get(path.c_str(), token); };
  EXPECT_EQ(get("/scene")->status, 404);
  EXPECT_EQ(io::ParseJson(get("/state")->body)["shows"], "nothing");
  EXPECT_EQ(get("/photo?index=0")->status, 400);
  EXPECT_EQ(get(FramePath("colour", 1))->status, 204);
}

TEST_F(ViewServerTest, RendersEveryLayer) {
  int sequence = 0;
  for (const char* layer : {"colour", "depth", "support"}) {
    const auto frame = Get(FramePath(layer, ++sequence));
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->status, 200) << layer;
    EXPECT_EQ(frame->body.substr(0, 3), "\xff\xd8\xff");
  }
  EXPECT_EQ(Get(FramePath("colour", 1))->status, 204);  // the page has asked for later ones
}

TEST_F(ViewServerTest, RefusesFramesThatMakeNoSense) {
  const std::string good = FramePath("colour", 1);
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string path = good;
    return path.replace(path.find(from), from.size(), to);
  };
  for (const std::string& path : {with("width=48", "width=100000"),
                                  with("width=48&height=32", "width=4096&height=4096"),
                                  with("width=48", "width=nan"),
                                  with("fov=0.8", "fov=0"),
                                  with("fov=0.8", "fov=inf"),
                                  with("layer=colour", "layer=secret"),
                                  with("quality=0", "quality=9"),
                                  with("quality=0", "quality=0&crop=%7B%7D"),
                                  with("quality=0", "quality=0&crop=x"),
                                  with("pose=", "pose=1,2,"),
                                  with("pose=", "pose=7"),
                                  std::string("/frame")})
    EXPECT_EQ(Get(path)->status, 400) << path;
}

TEST_F(ViewServerTest, OnlyItsOwnPageWithTheTokenIsAnswered) {
  for (const char* path : {"/", "/scene", "/state", "/frame", "/photo?index=0", "/path", "/absent"}) {
    EXPECT_EQ(client_.Get(path)->status, 403) << path;
    EXPECT_EQ(client_.Get(path, {{"X-Token", server_.token() + "0"}})->status, 403);
    EXPECT_EQ(client_.Get(path, {{"X-Token", ""}})->status, 403);
    const auto foreign = [&](const char* name, const char* value) {
      httplib::Headers headers = token_;
      headers.emplace(name, value);
      return client_.Get(path, headers)->status;
    };
    EXPECT_EQ(foreign("Host", "attacker.example"), 403);
    EXPECT_EQ(foreign("Origin", "http://attacker.example"), 403);
  }
  EXPECT_EQ(client_.Post("/end", "", "text/plain")->status, 403);
  EXPECT_FALSE(fs::exists(small_->path() / ".view/end"));
}

TEST_F(ViewServerTest, NoFileIsReachable) {
  for (const char* path : {"/run.json",
                           "/../../etc/passwd",
                           "/%2e%2e/%2e%2e/etc/passwd",
                           "/scene/",
                           "/..",
                           "/scene/transforms_train.json",
                           "//etc/passwd"})
    EXPECT_EQ(Get(path)->status, 404) << path;
}

TEST_F(ViewServerTest, SavesTheCameraPath) {
  EXPECT_EQ(Get("/path")->body, "{}");
  const std::string keyframe =
      R"({"matrix": [1,0,0,0, 0,1,0,0, 0,0,1,5, 0,0,0,1], "fov": 50, "aspect": 1.5})";
  const std::string body =
      R"({"render_width": 64, "render_height": 48, "fps": 10, "seconds": 1, "keyframes": [)" + keyframe +
      "," + keyframe + "]}";
  const auto post = [&](const std::string& path, const std::string& text) {
    return client_.Post(path.c_str(), token_, text, "application/json");
  };
  EXPECT_EQ(io::ParseJson(post("/path?save=0", body)->body)["frames"].size(), 10u);
  EXPECT_FALSE(fs::exists(small_->path() / "camera_path.json"));
  EXPECT_EQ(post("/path?save=1", body)->status, 200);
  EXPECT_EQ(ReadCameraPath(small_->path() / "camera_path.json").frames.size(), 10u);
  EXPECT_EQ(io::ParseJson(Get("/path")->body)["keyframes"].size(), 2u);
  EXPECT_EQ(post("/path?save=1", "{")->status, 400);
  EXPECT_EQ(post("/path?save=1", std::string(2 << 20, ' '))->status, 413);
  EXPECT_EQ(ReadCameraPath(small_->path() / "camera_path.json").frames.size(), 10u);
  fs::remove(small_->path() / "camera_path.json");
}

TEST_F(ViewServerTest, EndsATrainingOnRequest) {
  EXPECT_EQ(client_.Post("/end", token_, "", "text/plain")->status, 200);
  EXPECT_TRUE(fs::exists(small_->path() / ".view/end"));
}

TEST_F(ViewServerTest, SurvivesHostileClients) {
  std::vector<int> silent;
  for (int i = 0; i < 8; ++i) silent.push_back(Connect());  // hold a place each
  for (const std::string& text :
       {std::string("\0\xff garbage\r\n\r\n", 13),
        std::string("GET / HTTP/9.9\r\nHost: x\r\n\r\n"),
        std::string("POST /path HTTP/1.1\r\nContent-Length: -1\r\n\r\n"),
        std::string("POST /path HTTP/1.1\r\nContent-Length: 1000000000000\r\n\r\nx"),
        "GET /" + std::string(100000, 'a') + " HTTP/1.1\r\n\r\n",
        std::string("GET /scene HTT")}) {
    const int s = Connect();
    Say(s, text);
    close(s);  // in the middle
  }
  // More than this process may have open, with both ends here.
  for (int i = 0; i < 1000; ++i) silent.push_back(Connect(false));
  for (const int s : silent) close(s);
  EXPECT_EQ(Get("/state")->status, 200);
}

TEST_F(ViewServerTest, ATakenPortIsAnError) {
  EXPECT_ERROR(
      ViewServer(&run_, &maker_, {.port = server_.port()}), io::ExitCode::kNoResources, "cannot be listened");
}

}  // namespace
}  // namespace pipeline
