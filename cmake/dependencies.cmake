# Every outside library, found once and given a name; rooms link these names and no others.
find_package(PkgConfig REQUIRED)
find_package(OpenMP REQUIRED)
find_package(Threads REQUIRED)
find_package(OpenCV REQUIRED COMPONENTS core imgproc imgcodecs features2d calib3d)
find_package(OpenEXR CONFIG REQUIRED)
find_package(embree 3 CONFIG REQUIRED)

pkg_check_modules(CJSON REQUIRED IMPORTED_TARGET libcjson)
pkg_check_modules(YAML REQUIRED IMPORTED_TARGET yaml-0.1)
pkg_check_modules(EXIF REQUIRED IMPORTED_TARGET libexif)
pkg_check_modules(RAW REQUIRED IMPORTED_TARGET libraw)
pkg_check_modules(XXHASH REQUIRED IMPORTED_TARGET libxxhash)
pkg_check_modules(SQLITE REQUIRED IMPORTED_TARGET sqlite3)
pkg_check_modules(CMOCKA REQUIRED IMPORTED_TARGET cmocka)
pkg_check_modules(APRILTAG REQUIRED IMPORTED_TARGET apriltag)
pkg_check_modules(PCL_SURFACE REQUIRED IMPORTED_TARGET
  pcl_common pcl_kdtree pcl_search pcl_features pcl_filters pcl_surface)

find_library(MESHOPTIMIZER_LIBRARY meshoptimizer REQUIRED)
find_library(MRCAL_LIBRARY mrcal REQUIRED)
find_library(CHOLMOD_LIBRARY cholmod REQUIRED)
find_library(LAPACKE_LIBRARY lapacke REQUIRED)
find_path(SUITESPARSE_INCLUDE cholmod.h PATH_SUFFIXES suitesparse REQUIRED)
