// Keypoints and descriptors of PCL for gas_registration.py, which compiles and runs this program.
//
//     pcl_features CLOUD OUT DETECTOR_RADIUS DESCRIPTOR_RADIUS PFH_KEYPOINTS
//
// CLOUD holds x, y, z in metres as 32-bit floats; the sensor is at the origin. OUT gets, for the detectors ISS, Harris3D and
// SIFT3D (on curvature) in this order, the number of keypoints, their positions, and for the descriptors FPFH, SHOT and
// PFH the width and a row per keypoint; all as 32-bit floats. Keypoints beyond the first PFH_KEYPOINTS, drawn at random, have
// no PFH but a row of NaN. Normals come from within half of DESCRIPTOR_RADIUS, at least ten neighbours.

#include <pcl/features/fpfh.h>
#include <pcl/features/normal_3d.h>
#include <pcl/features/pfh.h>
#include <pcl/features/shot.h>
#include <pcl/keypoints/harris_3d.h>
#include <pcl/keypoints/iss_3d.h>
#include <pcl/keypoints/sift_keypoint.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <limits>
#include <random>
#include <vector>

using Point = pcl::PointXYZ;
using Cloud = pcl::PointCloud<Point>;
using Normals = pcl::PointCloud<pcl::Normal>;
using Tree = pcl::search::KdTree<Point>;
using Rows = std::vector<std::vector<float>>;

namespace {

// More keypoints are thinned to this number at random: descriptors take the time.
constexpr std::size_t kMost = 400;

struct Scene {
    Cloud::Ptr cloud{new Cloud};
    Normals::Ptr normals{new Normals};
    Tree::Ptr tree{new Tree};
    double detector_radius = 0, descriptor_radius = 0;
};

Cloud::Ptr read(const char *path) {
    std::ifstream file(path, std::ios::binary);
    Cloud::Ptr cloud(new Cloud);
    float p[3];
    while (file.read(reinterpret_cast<char *>(p), sizeof p)) {
        cloud->push_back(Point(p[0], p[1], p[2]));
    }
    return cloud;
}

// Normals towards the origin, from within a radius or from ten neighbours where those are more.
void estimate_normals(Scene &scene) {
    pcl::NormalEstimation<Point, pcl::Normal> estimation;
    std::vector<int> near;
    std::vector<float> squares;
    scene.normals->resize(scene.cloud->size());
    for (std::size_t i = 0; i < scene.cloud->size(); ++i) {
        const Point &p = (*scene.cloud)[i];
        if (scene.tree->radiusSearch(p, scene.descriptor_radius / 2, near, squares) < 10) {
            scene.tree->nearestKSearch(p, 10, near, squares);
        }
        pcl::Normal &n = (*scene.normals)[i];
        if (!estimation.computePointNormal(*scene.cloud, near, n.normal_x, n.normal_y, n.normal_z, n.curvature)) {
            n.normal_x = n.normal_y = n.curvature = 0;
            n.normal_z = 1;
        }
        pcl::flipNormalTowardsViewpoint(p, 0.f, 0.f, 0.f, n.normal_x, n.normal_y, n.normal_z);
    }
}

Cloud::Ptr iss(const Scene &scene) {
    pcl::ISSKeypoint3D<Point, Point> detector;
    Cloud::Ptr found(new Cloud);
    detector.setSearchMethod(scene.tree);
    detector.setSalientRadius(scene.detector_radius);
    detector.setNonMaxRadius(scene.detector_radius * 2 / 3);
    detector.setThreshold21(0.975);
    detector.setThreshold32(0.975);
    detector.setMinNeighbors(5);
    detector.setInputCloud(scene.cloud);
    detector.compute(*found);
    return found;
}

Cloud::Ptr harris(const Scene &scene) {
    pcl::HarrisKeypoint3D<Point, pcl::PointXYZI> detector;
    pcl::PointCloud<pcl::PointXYZI> found;
    detector.setSearchMethod(scene.tree);
    detector.setNonMaxSupression(true);
    detector.setRefine(false);
    detector.setRadius(scene.detector_radius);
    detector.setThreshold(1e-4F);
    detector.setNormals(scene.normals);
    detector.setInputCloud(scene.cloud);
    detector.compute(found);
    Cloud::Ptr points(new Cloud);
    for (const auto &p : found) {
        points->push_back(Point(p.x, p.y, p.z));
    }
    return points;
}

Cloud::Ptr sift(const Scene &scene) {
    pcl::PointCloud<pcl::PointNormal>::Ptr with_normals(new pcl::PointCloud<pcl::PointNormal>);
    for (std::size_t i = 0; i < scene.cloud->size(); ++i) {
        pcl::PointNormal p;
        p.getVector3fMap() = (*scene.cloud)[i].getVector3fMap();
        p.getNormalVector3fMap() = (*scene.normals)[i].getNormalVector3fMap();
        p.curvature = (*scene.normals)[i].curvature;
        with_normals->push_back(p);
    }
    pcl::SIFTKeypoint<pcl::PointNormal, pcl::PointWithScale> detector;
    pcl::PointCloud<pcl::PointWithScale> found;
    pcl::search::KdTree<pcl::PointNormal>::Ptr tree(new pcl::search::KdTree<pcl::PointNormal>);
    detector.setSearchMethod(tree);
    detector.setScales(static_cast<float>(scene.detector_radius) / 2, 3, 4);
    detector.setMinimumContrast(0.001F);
    detector.setInputCloud(with_normals);
    detector.compute(found);
    Cloud::Ptr points(new Cloud);
    for (const auto &p : found) {
        points->push_back(Point(p.x, p.y, p.z));
    }
    return points;
}

void thin(Cloud &keypoints) {
    std::mt19937 random(0);
    std::shuffle(keypoints.begin(), keypoints.end(), random);
    keypoints.resize(std::min(keypoints.size(), kMost));
}

// For each detector a row per keypoint. All are asked for at once, since FPFH needs a histogram of every point near one of
// them; beyond the first `most` of a detector rows are NaN.
template <typename Descriptor, typename Estimation>
std::vector<Rows> described(const Scene &scene, const std::vector<Cloud::Ptr> &keypoints, std::size_t most, int width,
                            const float *(*values)(const Descriptor &)) {
    Cloud::Ptr all(new Cloud);
    for (const auto &of_one : keypoints) {
        all->insert(all->end(), of_one->begin(), of_one->begin() + std::min(most, of_one->size()));
    }
    Estimation estimation;
    pcl::PointCloud<Descriptor> found;
    estimation.setInputCloud(all);
    estimation.setSearchSurface(scene.cloud);
    estimation.setInputNormals(scene.normals);
    estimation.setSearchMethod(scene.tree);
    estimation.setRadiusSearch(scene.descriptor_radius);
    if (!all->empty()) {
        estimation.compute(found);
    }
    std::vector<Rows> rows;
    auto next = found.begin();
    for (const auto &of_one : keypoints) {
        Rows own(of_one->size(), std::vector<float>(width, std::numeric_limits<float>::quiet_NaN()));
        for (std::size_t i = 0; i < std::min(most, own.size()); ++i, ++next) {
            own[i].assign(values(*next), values(*next) + width);
        }
        rows.push_back(std::move(own));
    }
    return rows;
}

void write(std::ofstream &out, float value) { out.write(reinterpret_cast<const char *>(&value), sizeof value); }

void write(std::ofstream &out, const Rows &rows, int width) {
    write(out, static_cast<float>(width));
    for (const auto &row : rows) {
        for (float value : row) {
            write(out, value);
        }
    }
}

}  // namespace

int main(int argc, char **argv) {
    if (argc != 6) {
        std::cerr << "usage: pcl_features CLOUD OUT DETECTOR_RADIUS DESCRIPTOR_RADIUS PFH_KEYPOINTS\n";
        return 2;
    }
    Scene scene;
    scene.cloud = read(argv[1]);
    scene.detector_radius = std::atof(argv[3]);
    scene.descriptor_radius = std::atof(argv[4]);
    const auto pfh_keypoints = static_cast<std::size_t>(std::atoi(argv[5]));
    scene.tree->setInputCloud(scene.cloud);
    estimate_normals(scene);
    std::vector<Cloud::Ptr> keypoints;
    for (auto *detect : {iss, harris, sift}) {
        keypoints.push_back(detect(scene));
        thin(*keypoints.back());
    }
    using Fpfh = pcl::FPFHSignature33;
    using Shot = pcl::SHOT352;
    using Pfh = pcl::PFHSignature125;
    const auto fpfh = described<Fpfh, pcl::FPFHEstimation<Point, pcl::Normal, Fpfh>>(
        scene, keypoints, kMost, 33, [](const Fpfh &d) -> const float * { return d.histogram; });
    const auto shot = described<Shot, pcl::SHOTEstimation<Point, pcl::Normal, Shot>>(
        scene, keypoints, kMost, 352, [](const Shot &d) -> const float * { return d.descriptor; });
    const auto pfh = described<Pfh, pcl::PFHEstimation<Point, pcl::Normal, Pfh>>(
        scene, keypoints, pfh_keypoints, 125, [](const Pfh &d) -> const float * { return d.histogram; });
    std::ofstream out(argv[2], std::ios::binary);
    for (std::size_t k = 0; k < keypoints.size(); ++k) {
        write(out, static_cast<float>(keypoints[k]->size()));
        for (const auto &p : *keypoints[k]) {
            for (float value : {p.x, p.y, p.z}) {
                write(out, value);
            }
        }
        write(out, fpfh[k], 33);
        write(out, shot[k], 352);
        write(out, pfh[k], 125);
    }
    return out.good() ? 0 : 1;
}
