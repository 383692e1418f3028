// The node that shows a log of commands; see docs/reference/sessions.md.
#include "meshless_surgery/ros/review_node.h"
#include "run_node.h"

int main(int argc, char** argv) { return meshless::runNode<meshless::ReviewNode>(argc, argv, "review"); }
