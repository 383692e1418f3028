// The node. Everything that it offers is private to its name; see docs/interface.md.
#include "meshless_surgery/ros/node.h"
#include "run_node.h"

int main(int argc, char** argv) { return meshless::runNode<meshless::DeformerNode>(argc, argv, "deformer"); }
