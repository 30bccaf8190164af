#include "leap_object_tracker/simulation/stereo_renderer.hpp"

#include <embree3/rtcore.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "body_surface.hpp"
#include "leap_object_tracker/simulation/hash_random.hpp"

namespace leap_object_tracker {
namespace {

using Eigen::Matrix3f;
using Eigen::Vector3f;

constexpr int kLeds = 3;
constexpr std::uint32_t kNothing = std::numeric_limits<std::uint32_t>::max();
constexpr float kNoDepth = std::numeric_limits<float>::infinity();
constexpr float kLedSpacing = 0.035F;    // [m] between neighbours, along the baseline
constexpr float kLedRadius = 0.0015F;    // [m] softens shadows
constexpr float kShadowOffset = 2e-5F;   // [m] keeps a surface from shading itself
constexpr float kCreaseCosine = 0.985F;  // neighbours whose normals differ more lie on an edge
constexpr float kUnseen = 0.05F;         // of the visible contrast: not worth a ray
constexpr std::size_t kSurfacePoints = 600;

/// Where a body is at a share of the exposure: as Embree does it, matrices blended linearly.
struct Path {
  Matrix3f turn_open, turn_close;
  Vector3f offset_open, offset_close;

  Vector3f apply(const Vector3f& point, float time) const {
    return (1 - time) * (turn_open * point + offset_open) +
           time * (turn_close * point + offset_close);
  }
  Vector3f rotate(const Vector3f& direction, float time) const {
    return (1 - time) * (turn_open * direction) + time * (turn_close * direction);
  }
};

struct Sphere {
  Vector3f center;
  float radius;

  /// Does the piece of a ray from `origin` to `length` along the unit `direction` come near?
  bool touches(const Vector3f& origin, const Vector3f& direction, float length) const {
    const Vector3f to_center = center - origin;
    const float along = std::clamp(to_center.dot(direction), 0.0F, length);
    return (to_center - along * direction).squaredNorm() < radius * radius;
  }
};

/// Light of each LED and of the surroundings that a ray brings back [counts/us].
struct Light {
  std::array<float, kLeds> of_led{};
  float ambient = 0;

  void add(const Light& other, float weight) {
    for (std::size_t i = 0; i < kLeds; ++i) of_led[i] += weight * other.of_led[i];
    ambient += weight * other.ambient;
  }
};

/// What one ray met.
struct Sight {
  Light light;
  float depth = kNoDepth;  ///< [m] along the ray
  Vector3f normal = Vector3f::Zero();
  std::uint32_t body = kNothing;
  std::uint8_t shaded = 0;  ///< bit i: a moving body keeps LED i from a resting surface
};

}  // namespace

class StereoRenderer::Impl {
 public:
  explicit Impl(const Scene& scene)
      : scene_(scene),
        lenses_{LeapLens(scene.unit.left, scene.mode), LeapLens(scene.unit.right, scene.mode)} {
    device_ = rtcNewDevice(nullptr);
    if (device_ == nullptr) throw std::runtime_error("Embree does not start on this processor");
    for (const auto& body : scene.bodies) addBody(body);
    samplePoints();
    const auto middle = static_cast<float>(scene.unit.baseline / 2);
    for (int i = 0; i < kLeds; ++i)
      leds_[static_cast<std::size_t>(i)] = {middle + kLedSpacing * static_cast<float>(i - 1), 0, 0};
    for (int eye = 0; eye < 2; ++eye) {
      auto& view = views_[static_cast<std::size_t>(eye)];
      view.origin = {eye == 0 ? 0.0F : static_cast<float>(scene.unit.baseline), 0, 0};
      makeView(view, lenses_[static_cast<std::size_t>(eye)]);
    }
  }

  ~Impl() {
    for (RTCScene scene : {resting_scene_, moving_scene_, object_scene_})
      if (scene != nullptr) rtcReleaseScene(scene);
    for (RTCScene shape : shapes_) rtcReleaseScene(shape);
    rtcReleaseDevice(device_);
  }

  StereoRadiance render(const std::vector<BodyPath>& paths, const std::array<bool, 3>& leds,
                        double contrast, std::uint64_t name) {
    if (paths.size() != shapes_.size())
      throw std::invalid_argument("StereoRenderer: " + std::to_string(paths.size()) +
                                  " paths for " + std::to_string(shapes_.size()) + " bodies");
    lit_ = leds;
    contrast_ = static_cast<float>(contrast);
    place(paths);
    // What was too dark to matter at a short exposure may show at a much longer one.
    constexpr float kFinerByFar = 0.2F;
    if (contrast_ < kFinerByFar * resting_contrast_) resting_changed_ = true;
    if (resting_changed_) resting_contrast_ = contrast_;
    StereoRadiance result;
    cv::Mat* const images[] = {&result.left, &result.right};
    for (std::size_t eye = 0; eye < 2; ++eye) {
      View& view = views_[eye];
      if (resting_changed_) renderResting(view, lenses_[eye], mixed(name, 10 + eye));
      *images[eye] = renderAll(view, lenses_[eye], mixed(name, 20 + eye));
    }
    resting_changed_ = false;
    return result;
  }

  double visibleShare(int eye) const {
    const auto& lens = lenses_[static_cast<std::size_t>(eye)];
    const auto& view = views_[static_cast<std::size_t>(eye)];
    int facing = 0, visible = 0;
    for (const auto& sample : surface_points_) {
      const Vector3f point = paths_[0].apply(sample.point, 0.5F);
      const Vector3f normal = paths_[0].rotate(sample.normal, 0.5F);
      const Vector3f toward_eye = view.origin - point;
      if (normal.dot(toward_eye) <= 0) continue;
      const Vector3f start = point + kShadowOffset * normal;
      if (blocked(object_scene_, start, view.origin - start, 0.5F)) continue;
      ++facing;
      const Eigen::Vector2d pixel = lens.pixel((-toward_eye).cast<double>());
      if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= scene_.mode.width - 1 &&
            pixel.y() <= scene_.mode.height - 1))
        continue;
      if (blocked(moving_scene_, start, view.origin - start, 0.5F)) continue;
      if (blocked(resting_scene_, start, view.origin - start, 0.5F)) continue;
      ++visible;
    }
    return facing > 0 ? static_cast<double>(visible) / facing : 0.0;
  }

  const LeapLens& lens(int eye) const { return lenses_[static_cast<std::size_t>(eye)]; }

 private:
  struct SurfacePoint {
    Vector3f point, normal;
  };

  /// One eye: what does not change from frame to frame.
  struct View {
    Vector3f origin;
    std::vector<Vector3f> rays;     ///< unit, one a pixel centre
    std::vector<float> vignetting;  ///< one a pixel
    std::vector<Sight> resting;     ///< pixel centres, resting bodies only
    std::vector<Sight> sights;      ///< pixel centres, all bodies
    std::vector<float> values;      ///< [counts/us] of sights
  };

  void addBody(const SceneBody& body) {
    surfaces_.emplace_back(body.mesh, body.edge_radius);
    const BodySurface& surface = surfaces_.back();
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                3 * sizeof(float), surface.vertices().size()));
    for (const auto& vertex : surface.vertices()) {
      std::copy(vertex.data(), vertex.data() + 3, vertices);
      vertices += 3;
    }
    auto* indices = static_cast<std::uint32_t*>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                3 * sizeof(std::uint32_t), surface.triangles().size()));
    for (const auto& triangle : surface.triangles())
      indices = std::copy(triangle.begin(), triangle.end(), indices);
    rtcCommitGeometry(geometry);
    RTCScene shape = rtcNewScene(device_);
    rtcSetSceneFlags(shape, RTC_SCENE_FLAG_ROBUST);
    rtcAttachGeometry(shape, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(shape);
    shapes_.push_back(shape);
  }

  /// Points spread evenly over the object's area.
  void samplePoints() {
    const BodySurface& surface = surfaces_.front();
    std::vector<double> area_up_to{0};
    for (const auto& t : surface.triangles()) {
      const auto& v = surface.vertices();
      area_up_to.push_back(area_up_to.back() + (v[t[1]] - v[t[0]]).cross(v[t[2]] - v[t[0]]).norm());
    }
    HashRandom random(1);
    for (std::size_t i = 0; i < kSurfacePoints; ++i) {
      const double at = area_up_to.back() * (static_cast<double>(i) + 0.5) / kSurfacePoints;
      const auto found = std::upper_bound(area_up_to.begin() + 1, area_up_to.end() - 1, at);
      const auto triangle = static_cast<std::uint32_t>(found - area_up_to.begin() - 1);
      auto u = static_cast<float>(random.uniform()), v = static_cast<float>(random.uniform());
      if (u + v > 1) u = 1 - u, v = 1 - v;
      surface_points_.push_back({surface.point(triangle, u, v), surface.normal(triangle, u, v)});
    }
  }

  void makeView(View& view, const LeapLens& lens) const {
    for (int v = 0; v < scene_.mode.height; ++v)
      for (int u = 0; u < scene_.mode.width; ++u) {
        view.rays.push_back(lens.ray(u, v).cast<float>().normalized());
        const double cosine = 1 / std::sqrt(1 + lens.rawRay(u, v).squaredNorm());
        view.vignetting.push_back(static_cast<float>(std::pow(cosine, scene_.sensor.vignetting)));
      }
    view.sights.resize(view.rays.size());
    view.values.resize(view.rays.size());
  }

  RTCScene newTopScene(const std::vector<std::uint32_t>& bodies) const {
    RTCScene top = rtcNewScene(device_);
    rtcSetSceneFlags(top, RTC_SCENE_FLAG_ROBUST);
    for (const auto body : bodies) {
      RTCGeometry instance = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_INSTANCE);
      rtcSetGeometryInstancedScene(instance, shapes_[body]);
      rtcSetGeometryTimeStepCount(instance, 2);
      const Path& path = paths_[body];
      for (unsigned step = 0; step < 2; ++step) {
        Eigen::Matrix<float, 3, 4> transform;
        transform << (step == 0 ? path.turn_open : path.turn_close),
            (step == 0 ? path.offset_open : path.offset_close);
        rtcSetGeometryTransform(instance, step, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, transform.data());
      }
      rtcCommitGeometry(instance);
      rtcAttachGeometryByID(top, instance, body);
      rtcReleaseGeometry(instance);
    }
    rtcCommitScene(top);
    return top;
  }

  void place(const std::vector<BodyPath>& paths) {
    const std::vector<Path> before = paths_;
    paths_.clear();
    for (const auto& path : paths)
      paths_.push_back({path.camera_from_body_at_open.linear().cast<float>(),
                        path.camera_from_body_at_close.linear().cast<float>(),
                        path.camera_from_body_at_open.translation().cast<float>(),
                        path.camera_from_body_at_close.translation().cast<float>()});

    // A body rests if it stays during this exposure and did not move since the last one.
    std::vector<std::uint32_t> resting, moving;
    for (std::uint32_t i = 0; i < paths_.size(); ++i) {
      const Path& path = paths_[i];
      const bool stays =
          path.turn_open == path.turn_close && path.offset_open == path.offset_close &&
          (before.empty() ||
           (before[i].turn_close == path.turn_open && before[i].offset_close == path.offset_open));
      // The object counts as moving: its share of the image is small, and it mostly does.
      (stays && i > 0 ? resting : moving).push_back(i);
    }
    if (resting != resting_bodies_ || resting_scene_ == nullptr) {
      resting_bodies_ = resting;
      resting_changed_ = true;
      replace(resting_scene_, newTopScene(resting));
    }
    replace(moving_scene_, newTopScene(moving));
    replace(object_scene_, newTopScene({0}));
    spheres_.clear();
    for (const auto body : moving) {
      const Path& path = paths_[body];
      spheres_.push_back({(path.offset_open + path.offset_close) / 2,
                          1.01F * surfaces_[body].radius() + 1e-4F +
                              (path.offset_open - path.offset_close).norm()});
    }
    float widest = 0;
    for (const auto body : moving) widest = std::max(widest, angleSwept(body));
    constexpr int kWidest = 8;  // [px] beyond, edges are so soft that a few lost rays do not show
    blur_pixels_ = std::min(kWidest, static_cast<int>(std::lround(widest * lenses_[0].fx())));
  }

  /// Largest angle [rad] that a corner of a body moves through while the shutter is open.
  float angleSwept(std::uint32_t body) const {
    const auto& vertices = surfaces_[body].vertices();
    constexpr std::size_t kMostCorners = 200;
    const std::size_t step = 1 + vertices.size() / kMostCorners;
    float widest = 0;
    for (std::size_t i = 0; i < vertices.size(); i += step) {
      const Vector3f before = paths_[body].apply(vertices[i], 0);
      const Vector3f after = paths_[body].apply(vertices[i], 1);
      widest = std::max(widest, (after.normalized() - before.normalized()).norm());
    }
    return widest;
  }

  static void replace(RTCScene& scene, RTCScene next) {
    if (scene != nullptr) rtcReleaseScene(scene);
    scene = next;
  }

  static bool blocked(RTCScene scene, const Vector3f& from, const Vector3f& span, float time) {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRay ray{from.x(), from.y(), from.z(), 0, span.x(), span.y(), span.z(), time, 1, ~0U, 0, 0};
    rtcOccluded1(scene, &context, &ray);
    return ray.tfar < 0;
  }

  bool nearMoving(const Vector3f& from, const Vector3f& direction, float length) const {
    return std::any_of(spheres_.begin(), spheres_.end(), [&](const Sphere& sphere) {
      return sphere.touches(from, direction, length);
    });
  }

  /// Shadow of one LED by the moving bodies, by a cheap test first.
  bool movingShadow(const Vector3f& from, const Vector3f& span, float time) const {
    const float length = span.norm();
    return nearMoving(from, span / length, length) && blocked(moving_scene_, from, span, time);
  }

  struct Met {
    RTCRayHit hit;
    bool anything = false;
  };

  static Met cast(RTCScene scene, const Vector3f& origin, const Vector3f& direction, float limit,
                  float time) {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    Met met;
    met.hit.ray = {origin.x(),
                   origin.y(),
                   origin.z(),
                   1e-4F,
                   direction.x(),
                   direction.y(),
                   direction.z(),
                   time,
                   limit,
                   ~0U,
                   0,
                   0};
    met.hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene, &context, &met.hit);
    met.anything = met.hit.hit.geomID != RTC_INVALID_GEOMETRY_ID;
    return met;
  }

  /// Light that a surface sends towards the eye: Lambert and Blinn and Phong, LEDs with inverse
  /// square and a cos^n lobe. @param jitter moves the point of an LED that is seen; zero: its
  /// middle
  Sight shade(const Met& met, const Vector3f& direction, float time, bool shadows_of_moving,
              const Eigen::Vector2f& jitter) const {
    const std::uint32_t body = met.hit.hit.instID[0];
    const BodySurface& surface = surfaces_[body];
    const Paint& paint = scene_.bodies[body].paint;
    const Path& path = paths_[body];
    const float u = met.hit.hit.u, v = met.hit.hit.v;
    const Vector3f in_body = surface.point(met.hit.hit.primID, u, v);
    const Vector3f at = path.apply(in_body, time);

    Sight sight;
    sight.body = body;
    sight.depth = met.hit.ray.tfar;
    sight.normal = path.rotate(surface.normal(met.hit.hit.primID, u, v), time).normalized();
    const Vector3f face_normal(met.hit.hit.Ng_x, met.hit.hit.Ng_y, met.hit.hit.Ng_z);
    if (path.rotate(face_normal, time).dot(direction) > 0)  // an open mesh, seen from inside
      sight.normal = -sight.normal;

    const float albedo = albedoAt(paint, in_body);
    const Vector3f from = at + kShadowOffset * sight.normal;
    for (std::size_t i = 0; i < kLeds; ++i) {
      const Vector3f led = leds_[i] + Vector3f(kLedRadius * jitter.x(), kLedRadius * jitter.y(), 0);
      const Vector3f span = led - from;
      const float distance = span.norm();
      const Vector3f toward_led = span / distance;
      const float cosine = sight.normal.dot(toward_led);
      const float lobe_cosine = -toward_led.z();
      if (cosine <= 0 || lobe_cosine <= 0) continue;
      const float falloff = static_cast<float>(scene_.light.power) *
                            std::pow(lobe_cosine, static_cast<float>(scene_.light.lobe_exponent)) /
                            (distance * distance);
      const Vector3f half_way = (toward_led - direction).normalized();
      const auto shininess = static_cast<float>(paint.shininess);
      const float tilt_cosine = sight.normal.dot(half_way);
      const float highlight = paint.gloss > 0 && tilt_cosine > 0
                                  ? static_cast<float>(paint.gloss) * (shininess + 2) / 8 *
                                        std::pow(tilt_cosine, shininess)
                                  : 0.0F;
      const float light = falloff * cosine * (albedo + highlight);
      if (light > kUnseen * contrast_) {
        if (blocked(resting_scene_, from, span, time)) continue;
        if (shadows_of_moving && movingShadow(from, span, time)) {
          sight.shaded |= static_cast<std::uint8_t>(1U << i);
          continue;
        }
      }
      sight.light.of_led[i] = light;
    }
    // More light from above than from below.
    sight.light.ambient =
        static_cast<float>(scene_.light.ambient) * albedo * (0.65F - 0.35F * sight.normal.y());
    return sight;
  }

  float valueOf(const Sight& sight) const {
    float value = sight.light.ambient;
    for (std::size_t i = 0; i < kLeds; ++i)
      if (lit_[i] && (sight.shaded >> i & 1U) == 0) value += sight.light.of_led[i];
    return value;
  }

  /// Any place within a pixel, any time of the exposure.
  Sight sampleAll(const View& view, const Vector3f& direction, float time,
                  const Eigen::Vector2f& jitter) const {
    Met met = cast(resting_scene_, view.origin, direction, kNoDepth, time);
    const float limit = met.anything ? met.hit.ray.tfar : kNoDepth;
    if (nearMoving(view.origin, direction, limit)) {
      const Met nearer = cast(moving_scene_, view.origin, direction, limit, time);
      if (nearer.anything) met = nearer;
    }
    if (!met.anything) return {};
    return shade(met, direction, time, true, jitter);
  }

  std::size_t index(int u, int v) const {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(scene_.mode.width) +
           static_cast<std::size_t>(u);
  }

  /// How many rays a pixel needs, if its neighbours differ so much that the one in its middle
  /// cannot speak for it; else 0. The higher an edge, the more: errors stay below the sensor's
  /// noise.
  template <class Ignore>
  int raysFor(const View& view, const std::vector<Sight>& sights, int u, int v, int reach,
              const Ignore& ignore) const {
    const Sight& here = sights[index(u, v)];
    const float value = view.values[index(u, v)];
    float step = 0;
    for (int y = std::max(0, v - reach); y <= std::min(scene_.mode.height - 1, v + reach); ++y)
      for (int x = std::max(0, u - reach); x <= std::min(scene_.mode.width - 1, u + reach); ++x) {
        const float difference = std::abs(view.values[index(x, y)] - value);
        if (difference < kUnseen * contrast_ || difference <= step) continue;
        const Sight& other = sights[index(x, y)];
        if (ignore(here, other)) continue;
        if (other.body != here.body || other.shaded != here.shaded ||
            (other.normal.dot(here.normal) < kCreaseCosine && difference > contrast_))
          step = difference;
      }
    if (step > 40 * contrast_) return scene_.samples;
    if (step > 12 * contrast_) return std::max(1, scene_.samples / 2);
    if (step > 0) return std::max(1, scene_.samples / 4);

    // An even slope of light is no texture: one ray in its middle is right.
    const auto bends = [&](int du, int dv) {
      if (u < du || v < dv || u + du >= scene_.mode.width || v + dv >= scene_.mode.height)
        return false;
      const std::size_t before = index(u - du, v - dv), after = index(u + du, v + dv);
      if (ignore(here, sights[before]) && ignore(here, sights[after])) return false;
      const float straight = 0.5F * (view.values[before] + view.values[after]);
      return std::abs(straight - value) > 2 * contrast_;
    };
    const bool textured = here.body != kNothing && (bends(1, 0) || bends(0, 1));
    return textured ? std::max(1, scene_.samples / 4) : 0;
  }

  /// Average over rays spread evenly over the pixel, the exposure and the LEDs' area.
  template <class Sample>
  Light average(const LeapLens& lens, int u, int v, int samples, std::uint64_t name,
                const Sample& sample) const {
    // Hammersley's points, digits scrambled (Kollig and Keller 2002): stratified along rows, along
    // columns and in both, so that the share of a pixel that a body covers is exact to about 1 / n.
    HashRandom random(name, index(u, v));
    const auto scramble = static_cast<std::uint32_t>(random.bits());
    const double start_x = random.uniform(), start_time = random.uniform();
    const double start_led = random.uniform();
    constexpr double kStepTime = 0.6180339887498949, kStepLed = 0.4142135623730951;
    const auto part = [](double x) { return x - std::floor(x); };
    Light sum;
    for (int i = 0; i < samples; ++i) {
      const double at_u = u - 0.5 + (i + start_x) / samples;
      const double at_v = v - 0.5 + (reversed(static_cast<std::uint32_t>(i)) ^ scramble) * 0x1p-32;
      const auto time = static_cast<float>(part(start_time + i * kStepTime));
      const double angle = 2 * M_PI * part(start_led + i * kStepLed);
      const double radius = std::sqrt(part(start_led + start_time + i * kStepTime));
      const Eigen::Vector2f jitter(static_cast<float>(radius * std::cos(angle)),
                                   static_cast<float>(radius * std::sin(angle)));
      const Vector3f direction = lens.ray(at_u, at_v).cast<float>().normalized();
      sum.add(sample(direction, time, jitter), 1.0F / static_cast<float>(samples));
    }
    return sum;
  }

  template <class Pixel>
  void eachPixel(const Pixel& pixel) const {
    tbb::parallel_for(0, scene_.mode.height, [&](int v) {
      for (int u = 0; u < scene_.mode.width; ++u) pixel(u, v);
    });
  }

  void renderResting(View& view, const LeapLens& lens, std::uint64_t name) const {
    std::vector<Sight> centers(view.rays.size());
    const auto sample = [&](const Vector3f& direction, float time, const Eigen::Vector2f& jitter) {
      const Met met = cast(resting_scene_, view.origin, direction, kNoDepth, time);
      return met.anything ? shade(met, direction, time, false, jitter) : Sight{};
    };
    eachPixel([&](int u, int v) {
      const std::size_t i = index(u, v);
      centers[i] = sample(view.rays[i], 0.5F, Eigen::Vector2f::Zero());
      view.values[i] = valueOf(centers[i]);
    });
    view.resting = centers;
    if (resting_bodies_.empty()) return;
    eachPixel([&](int u, int v) {
      const int rays =
          raysFor(view, centers, u, v, 1, [](const Sight&, const Sight&) { return false; });
      if (rays == 0) return;
      const auto light_only = [&](const Vector3f& direction, float time,
                                  const Eigen::Vector2f& jitter) {
        return sample(direction, time, jitter).light;
      };
      view.resting[index(u, v)].light = average(lens, u, v, rays, name, light_only);
    });
  }

  /// The bits from last to first: van der Corput's sequence.
  static std::uint32_t reversed(std::uint32_t x) {
    x = (x >> 1 & 0x55555555U) | (x & 0x55555555U) << 1;
    x = (x >> 2 & 0x33333333U) | (x & 0x33333333U) << 2;
    x = (x >> 4 & 0x0f0f0f0fU) | (x & 0x0f0f0f0fU) << 4;
    x = (x >> 8 & 0x00ff00ffU) | (x & 0x00ff00ffU) << 8;
    return x >> 16 | x << 16;
  }

  /// The ray in the middle of a pixel, with the moving bodies before what rests there.
  Sight sightOfCenter(const View& view, std::size_t pixel) const {
    const Vector3f& direction = view.rays[pixel];
    const Sight& resting = view.resting[pixel];
    if (nearMoving(view.origin, direction, resting.depth)) {
      const Met met = cast(moving_scene_, view.origin, direction, resting.depth, 0.5F);
      if (met.anything) return shade(met, direction, 0.5F, true, Eigen::Vector2f::Zero());
    }
    Sight sight = resting;
    if (resting.body == kNothing) return sight;
    const Vector3f from = view.origin + resting.depth * direction + kShadowOffset * resting.normal;
    for (std::size_t led = 0; led < kLeds; ++led)
      if (lit_[led] && resting.light.of_led[led] > kUnseen * contrast_ &&
          movingShadow(from, leds_[led] - from, 0.5F))
        sight.shaded |= static_cast<std::uint8_t>(1U << led);
    return sight;
  }

  cv::Mat renderAll(View& view, const LeapLens& lens, std::uint64_t name) const {
    // Columns of each row that a moving body covers or shades.
    std::vector<cv::Range> touched(static_cast<std::size_t>(scene_.mode.height),
                                   cv::Range(scene_.mode.width, 0));
    eachPixel([&](int u, int v) {
      const std::size_t i = index(u, v);
      const Sight sight = sightOfCenter(view, i);
      view.sights[i] = sight;
      view.values[i] = valueOf(sight);
      if (rests(sight.body) && sight.shaded == 0) return;
      cv::Range& columns = touched[static_cast<std::size_t>(v)];
      columns.start = std::min(columns.start, u);
      columns.end = std::max(columns.end, u + 1);
    });

    // Borders between resting things are in view.resting already.
    const auto both_rest = [&](const Sight& a, const Sight& b) {
      return rests(a.body) && rests(b.body) && a.shaded == b.shaded;
    };
    cv::Mat image(scene_.mode.height, scene_.mode.width, CV_32FC1);
    const int reach = 1 + blur_pixels_;
    const auto nearTouched = [&](int u, int v) {
      for (int y = std::max(0, v - reach); y <= std::min(scene_.mode.height - 1, v + reach); ++y) {
        const cv::Range& columns = touched[static_cast<std::size_t>(y)];
        if (u >= columns.start - reach && u < columns.end + reach) return true;
      }
      return false;
    };
    eachPixel([&](int u, int v) {
      float value = view.values[index(u, v)];
      const int rays = nearTouched(u, v) ? raysFor(view, view.sights, u, v, reach, both_rest) : 0;
      if (rays > 0) {
        const auto sample = [&](const Vector3f& direction, float time,
                                const Eigen::Vector2f& jitter) {
          Light light;
          light.ambient = valueOf(sampleAll(view, direction, time, jitter));
          return light;
        };
        value = average(lens, u, v, rays, name, sample).ambient;
      }
      image.at<float>(v, u) = value * view.vignetting[index(u, v)];
    });
    return image;
  }

  bool rests(std::uint32_t body) const {
    return body == kNothing ||
           std::binary_search(resting_bodies_.begin(), resting_bodies_.end(), body);
  }

  Scene scene_;
  std::array<LeapLens, 2> lenses_;
  RTCDevice device_ = nullptr;
  std::vector<RTCScene> shapes_;  ///< one a body
  RTCScene resting_scene_ = nullptr, moving_scene_ = nullptr, object_scene_ = nullptr;
  std::vector<BodySurface> surfaces_;
  std::vector<SurfacePoint> surface_points_;
  std::array<Vector3f, kLeds> leds_;
  std::array<View, 2> views_;
  std::vector<Path> paths_;
  std::vector<std::uint32_t> resting_bodies_;
  std::vector<Sphere> spheres_;  ///< round the moving bodies
  std::array<bool, 3> lit_{};
  float contrast_ = 0;          ///< [counts/us] that shows
  float resting_contrast_ = 0;  ///< the same when the resting bodies were rendered
  int blur_pixels_ = 0;
  bool resting_changed_ = true;
};

StereoRenderer::StereoRenderer(const Scene& scene) : impl_(std::make_unique<Impl>(scene)) {}
StereoRenderer::~StereoRenderer() = default;

StereoRadiance StereoRenderer::render(const std::vector<BodyPath>& paths,
                                      const std::array<bool, 3>& leds, double contrast,
                                      std::uint64_t name) {
  return impl_->render(paths, leds, contrast, name);
}
double StereoRenderer::visibleShare(int eye) const { return impl_->visibleShare(eye); }
const LeapLens& StereoRenderer::lens(int eye) const { return impl_->lens(eye); }

}  // namespace leap_object_tracker
