/* whittle: reduces triangle meshes larger than memory. The public interface of libwhittle. */
#ifndef WHITTLE_H
#define WHITTLE_H

#define WHITTLE_VERSION "0.1.0"

#endif
