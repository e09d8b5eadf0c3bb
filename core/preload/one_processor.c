/* Loaded into a child before its own libraries: the C library's count of processors, which C++'s thread library asks, says one. */
int get_nprocs(void);
int get_nprocs_conf(void);

int get_nprocs(void) { return 1; }
int get_nprocs_conf(void) { return 1; }
