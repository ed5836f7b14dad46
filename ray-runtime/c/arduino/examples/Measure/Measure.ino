// Prints the point that two pixels see. The blob is a source file beside the sketch: calib-offline export rig.rays -o rig.c --format c
#include <rays.h>

extern "C" const uint8_t rays_blob[];
extern "C" const size_t rays_blob_len;

static rays_rig rig;

void setup() {
  Serial.begin(115200);
  int code = rays_open(&rig, rays_blob, rays_blob_len);
  Serial.print("opened: ");
  Serial.println(code);
}

void loop() {
  rays_point point;
  int code = rays_triangulate(&rig, {0, 320.0f, 240.0f}, {1, 300.0f, 240.0f}, &point);
  if (code == RAYS_OK) {
    Serial.println(point.point_mm[2]);
  } else {
    Serial.println(code);
  }
  delay(1000);
}
