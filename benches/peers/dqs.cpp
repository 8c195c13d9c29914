// libigl's dual quaternion skinning beside ours: `dqs REST WEIGHTS MATRICES OUT` reads the files of `skin_points`, skins, writes
// the positions and prints CPU seconds of one pose, the least of several. Build: c++ -O3 -march=native -I EIGEN -I LIBIGL/include.
#include <Eigen/Geometry>
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <igl/dqs.h>
#include <vector>

static double cpu() {
    timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

static std::vector<double> numbers(const char *path) {
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    std::vector<double> values(file.tellg() / sizeof(double));
    file.seekg(0).read(reinterpret_cast<char *>(values.data()), values.size() * sizeof(double));
    return values;
}

int main(int count, char **words) {
    if (count != 5) {
        std::fprintf(stderr, "usage: dqs REST WEIGHTS MATRICES OUT\n");
        return 2;
    }
    using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    auto rest = numbers(words[1]), weights = numbers(words[2]), matrices = numbers(words[3]);
    long n = rest.size() / 3, joints = matrices.size() / 16;
    Eigen::MatrixXd V = Eigen::Map<Rows>(rest.data(), n, 3), W = Eigen::Map<Rows>(weights.data(), n, joints), U;
    std::vector<Eigen::Quaterniond, Eigen::aligned_allocator<Eigen::Quaterniond>> turns;
    std::vector<Eigen::Vector3d> shifts;
    for (long j = 0; j < joints; j++) {
        Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> m(matrices.data() + 16 * j);
        turns.emplace_back(Eigen::Matrix3d(m.topLeftCorner<3, 3>()));
        shifts.emplace_back(m.topRightCorner<3, 1>());
    }
    double least = 1e9;
    for (int round = 0; round < 5; round++) {
        double began = cpu();
        igl::dqs(V, W, turns, shifts, U);
        least = std::min(least, cpu() - began);
    }
    Rows out = U;
    std::ofstream(words[4], std::ios::binary).write(reinterpret_cast<char *>(out.data()), out.size() * sizeof(double));
    std::printf("%.9f\n", least);
}
