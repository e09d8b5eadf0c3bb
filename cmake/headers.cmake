# Headers that are installed: those that declare what libtsuya exports (TSUYA_API), and what they stand on.
# tests/app/check_headers.sh holds this list against the tree.
set(TSUYA_PUBLIC_HEADERS
  brdf/material.h
  core/api.h
  core/camera.h
  core/context.h
  core/file.h
  core/geometry.h
  core/image.h
  core/json.h
  core/memory.h
  core/mesh.h
  core/photo.h
  core/process.h
  core/raster.h
  core/status.h
  core/table.h
  core/yaml.h
)
